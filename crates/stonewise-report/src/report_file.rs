//! The report file.

use super::page::{page, yearly};
use super::summary::Summary;
use super::tables::write_tables;
use std::path::{Path, PathBuf};
use stonewise_base::error::Error;
use stonewise_io::atomic::write_atomically;
use stonewise_results::ResultSet;
use stonewise_results::names::{PairFile, REPORT_DIR, YEARLY};

/// Makes `report.html` from the result files in `dir` alone and returns its path.
///
/// One self-contained file: no network, light and dark, printable. With more than two epochs, the report of
/// the third against the first is `data/report_2.html`, and so on; each links to the others; `yearly.html` is
/// the part of the yearly safety report on measurements, with its tables as CSV in `data/report`. The same
/// results give the same bytes.
///
/// # Errors
/// `dir` has no stone table, a result file is damaged, or the report cannot be written.
pub fn write_report(dir: &Path) -> Result<PathBuf, Error> {
    let results = ResultSet::read(dir)?;
    let write = |results: &ResultSet| -> Result<PathBuf, Error> {
        let path = dir.join(PairFile::ReportPage.place(results.pair));
        let page = page(results, &Summary::new(results))?;
        write_atomically(&path, |partial| std::fs::write(partial, page))
            .map_err(Error::io("writing the report", &path))?;
        Ok(path)
    };
    let path = write(&results)?;
    let mut all = vec![results];
    for pair in 2..=all[0].pairs {
        all.push(ResultSet::read_pair(dir, pair)?);
        write(&all[pair - 1])?;
    }
    if all.len() > 1 {
        write_tables(&dir.join(REPORT_DIR), &all)?;
        if let Some(page) = all
            .last()
            .and_then(|newest| yearly(newest, &Summary::new(newest)))
        {
            let path = dir.join(YEARLY);
            write_atomically(&path, |partial| std::fs::write(partial, page))
                .map_err(Error::io("writing the report", &path))?;
        }
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, outlines, registration_record, rows, run_record};
    use crate::texts::Texts;
    use serde::Deserialize;
    use serde_json::Value;
    use std::collections::BTreeSet;
    use stonewise_base::files::write_json;
    use stonewise_base::profile::{Chapter, Profile};
    use stonewise_base::report_params::{Language, ReportParams};
    use stonewise_base::thresholds::Thresholds;
    use stonewise_base::warnings::Warning;
    use stonewise_core::evaluate::{Evaluation, EvaluationParams, score_motions};
    use stonewise_core::series::SeriesAnswers;
    use stonewise_results::names::{PROFILE, REMARKS, RUN, TRENDS, VERDICT};
    use stonewise_results::records::{
        Datum, EpochVerdict, EstimateRecord, EstimatorRecord, PathPoint, RegistrationRecord, Remark, Remarks,
        RunRecord, SeriesVerdict, Signature, StepTime, TRENDS_VERSION, Timestamp, TrendsRecord, Verdict,
        ZoneTrend, signed_digest,
    };
    use stonewise_results::{Status, StoneRow, write_logo, write_outlines, write_stones};

    /// Result files with these rows and this run.json, and the report made of them.
    fn report(rows: &[StoneRow], run: Option<&RunRecord>) -> String {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), 1, rows).unwrap();
        write_outlines(folder.path(), &outlines()).unwrap();
        if let Some(run) = run {
            write_json(&folder.path().join(RUN), run).unwrap();
        }
        let points = "x,y,z,nx,ny,nz,m3c2_distance,m3c2_uncertainty\n100,200.4,50.25,1,0,0,0.004,0.001\n";
        std::fs::write(folder.path().join("data/m3c2.csv"), points).unwrap();
        let evaluation = Evaluation::new("a <known> motion", &EvaluationParams::default());
        let evaluation = Evaluation {
            stones: Some(score_motions(&[], 3, &EvaluationParams::default())),
            ..evaluation
        };
        let json = serde_json::to_string(&evaluation).unwrap();
        std::fs::write(folder.path().join("data/evaluation.json"), json).unwrap();
        let decisions = "event,photo,instance\nmerged_instance,<script>.jpg,4\nmerged_instance,b.jpg,5\n";
        std::fs::write(folder.path().join("data/audit_epoch1.csv"), decisions).unwrap();
        write_json(
            &folder.path().join("data/registration.json"),
            &registration_record(),
        )
        .unwrap();
        let path = write_report(folder.path()).unwrap();
        let html = std::fs::read_to_string(&path).unwrap();
        assert_eq!(
            std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap(),
            html,
            "bytes differ"
        );
        html
    }

    /// The page without the embedded program and its style, whose texts are not the report's.
    fn written(html: &str) -> String {
        use crate::page::{SCRIPT, STYLE};
        html.replace(SCRIPT, "").replace(STYLE, "")
    }

    /// Every opened element is closed, in order.
    fn check_nesting(html: &str) {
        let void = ["meta", "path", "rect", "i", "input", "br", "img", "wbr"];
        let mut open: Vec<&str> = Vec::new();
        let body = &html[html.find("<header>").unwrap()..html.find("</main>").unwrap() + 7];
        for tag in body.split('<').skip(1) {
            let name = tag
                .trim_start_matches('/')
                .split([' ', '>', '\n', '/'])
                .next()
                .unwrap();
            if tag.starts_with('/') {
                if !void.contains(&name) {
                    assert_eq!(open.pop(), Some(name), "before </{tag}");
                }
            } else if !void.contains(&name) {
                open.push(name);
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn remarks_and_a_signature_are_printed_while_it_holds() {
        let folder = folder(&rows());
        write_json(&folder.path().join(RUN), &run_record("Wall", &["A", "B"])).unwrap();
        let page = || std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap();
        assert!(page().contains("<p>Assessed by</p>"));
        let remark = |epoch: &str, text: &str| Remark {
            stone: Some(8),
            zone: None,
            epoch: epoch.to_owned(),
            who: "A. <Bell>".to_owned(),
            when: Timestamp::EPOCH,
            text: text.to_owned(),
        };
        let remarks = Remarks {
            remarks: vec![
                remark("B", "looked at & found sound"),
                remark("C", "of another epoch"),
            ],
            signature: Some(Signature {
                who: "A. <Bell>".to_owned(),
                place: "Lower dam".to_owned(),
                when: Timestamp::EPOCH,
                blake3: signed_digest(folder.path()).unwrap(),
            }),
        };
        write_json(&folder.path().join(REMARKS), &remarks).unwrap();
        let signed = page();
        check_nesting(&signed);
        for words in [
            "<b>A. &lt;Bell&gt;</b><br>Assessed by",
            "<b>Lower dam, 1970-01-01</b>",
            "<li><b>Stone 8</b>: looked at &amp; found sound",
        ] {
            assert!(signed.contains(words), "{words}");
        }
        assert!(!signed.contains("of another epoch"));
        write_stones(folder.path(), 1, &rows()[..20]).unwrap();
        let changed = page();
        assert!(changed.contains("signed other results on 1970-01-01"));
        assert!(changed.contains("<p>Assessed by</p>"));
    }

    #[test]
    fn where_no_stone_is_measured_the_scale_is_that_of_the_m3c2_distances() {
        let mut rows = rows();
        for row in &mut rows {
            row.status = Status::UnmatchedLost;
            row.motion = None;
        }
        // The one distance is 4 mm.
        let html = report(&rows, Some(&run_record("Test wall", &["A", "B"])));
        assert!(html.contains("\"component\":5.0"));
    }

    #[test]
    fn it_says_what_moved_and_shows_it() {
        let html = report(&rows(), Some(&run_record("Test wall", &["A", "B"])));
        check_nesting(&html);
        for id in [
            "summary",
            "maps",
            "tables",
            "distributions",
            "datum",
            "evaluation",
            "method",
            "audit",
        ] {
            assert!(html.contains(&format!("<section id=\"{id}\">")), "{id}");
        }
        assert!(html.contains("<b>20 <small>83\u{a0}%</small></b><span>of 24 stones measured"));
        assert!(
            html.contains("<div class=\"verdict cannot-tell\"")
                && html.contains("Cannot tell: the adjustment did not converge")
        );
        // Nothing below contradicts that.
        assert!(html.contains("<p class=\"hedge\">All numbers below are as computed"));
        assert!(html.contains("<b>\u{2013}</b><span>which stones moved or are loose cannot be told"));
        assert!(html.contains("<b>Detection limit: cannot be stated for results in doubt</b>"));
        let text = written(&html);
        for claim in [
            "false discovery rate",
            "Largest motions",
            "Loose stones",
            "moved 20",
            "class=\"loose\"",
        ] {
            assert!(!text.contains(claim), "{claim}");
        }
        assert!(html.contains("<code>unmatched_lost</code>") && html.contains("<code>unobservable</code>"));
        assert_eq!(
            html.matches("<svg role=\"img\"").count(),
            9 + 3 + 3,
            "maps, histograms, scatter plots"
        );
        assert!(html.contains("<td>Merged instance</td><td class=\"n\">2</td>"));
        assert!(html.contains(
            "Registration error between the surveys: the stable areas show a registration error of 3.2\u{a0}mm."
        ));
        assert!(
            html.contains("finished <b>2026-04-30 12:00 UTC</b>")
                && html.contains("temperature 9.5\u{a0}\u{b0}C")
        );
        assert!(html.contains("x 1.2 \u{b1} 1.0 mm, y 0.0 \u{b1} 2.0 mm, z \u{2212}3.0 \u{b1} 1.0 mm"));
        assert!(html.contains("class=\"hatch\""));
        let html = written(&html);
        assert_eq!(no_number(&html), None, "a value that is no number");
    }

    #[test]
    fn it_needs_no_network_and_names_from_files_are_harmless() {
        let mut run = run_record("</title><script>alert(1)</script>", &["\" onload=\"x", "<b>"]);
        run.steps = vec![StepTime {
            step: "<i>".to_owned(),
            seconds: 1.234_567_89,
            processor_seconds: Some(2.5),
            resumed: false,
            peak_memory_bytes: None,
        }];
        run.warnings = vec![Warning {
            step: "label".to_owned(),
            subject: "<script>.jpg".to_owned(),
            code: None,
            message: "'&'".to_owned(),
            translations: Default::default(),
            skipped_input: true,
            doubt: false,
        }];
        let html = report(&rows(), Some(&run));
        check_nesting(&html);
        assert!(
            !html.contains("<script>alert") && !html.contains("<script>.jpg") && !html.contains("<known>")
        );
        assert!(html.contains("<td>&lt;i&gt;</td><td class=\"n\">1.2</td><td class=\"n\">2.5</td>"));
        assert!(html.contains("&lt;script&gt;.jpg") && html.contains("left out"));
        assert_eq!(
            html.matches("</script").count(),
            5,
            "document, three blocks, program"
        );
        assert!(html.contains("default-src 'none'; script-src 'nonce-"));
        let html = written(&html);
        for door in ["http://", "https://", "src=", "@import", "url(//"] {
            assert!(!html.contains(door), "{door}");
        }
    }

    #[test]
    fn a_run_without_matches_or_without_stones_has_a_report() {
        let mut unmatched = rows();
        for row in &mut unmatched {
            (row.motion, row.status) = (None, Status::UnmatchedUnseen);
        }
        let html = report(&unmatched, None);
        check_nesting(&html);
        assert!(html.contains("No stone was measured.") && html.contains("class=\"hatch\""));
        check_nesting(&report(&[], None));
    }

    /// A word for a value that is no number, with what stands before it.
    fn no_number(html: &str) -> Option<&str> {
        let words = html.split(|c: char| !c.is_alphabetic());
        let found = words.into_iter().find(|word| ["NaN", "inf"].contains(word))?;
        let at = found.as_ptr() as usize - html.as_ptr() as usize;
        html.get(at.saturating_sub(100)..at + 3)
    }

    #[test]
    fn values_that_are_no_numbers_do_not_spoil_it() {
        let mut odd = rows();
        odd[0].centroid.x = f64::NAN;
        odd[1].motion.as_mut().unwrap().face.x = f64::NAN;
        odd[4].motion.as_mut().unwrap().detection_limit_m = f64::INFINITY;
        odd[5].area_m2 = 0.0;
        let html = written(&report(&odd, None));
        check_nesting(&html);
        assert_eq!(no_number(&html), None);
    }

    #[test]
    fn every_later_epoch_has_its_report_and_links_to_the_others() {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), 1, &rows()).unwrap();
        write_stones(folder.path(), 2, &rows()[..20]).unwrap();
        write_json(&folder.path().join(RUN), &run_record("Wall", &["A", "B", "<C>"])).unwrap();
        write_report(folder.path()).unwrap();
        let page = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(
            page("report.html").contains("of 24 stones")
                && page("data/report_2.html").contains("of 20 stones")
        );
        assert!(page("report.html").contains("<a href=\"data/report_2.html\">A \u{2192} &lt;C&gt;</a>"));
        assert!(page("data/report_2.html").contains("<a href=\"../report.html\">A \u{2192} B</a>"));
    }

    /// A series of three epochs with one zone, which moved out by 1 and 2 mm.
    fn series(language: Language) -> tempfile::TempDir {
        let folder = folder(&rows());
        write_stones(folder.path(), 2, &rows()).unwrap();
        let mut run = run_record("Wall", &["A", "B", "C <3>"]);
        run.parameters.report.language = language;
        write_json(&folder.path().join(RUN), &run).unwrap();
        let on = |epoch: &str| EpochVerdict {
            epoch: epoch.to_owned(),
            sentence: format!("Fine: {epoch}."),
            ..EpochVerdict::default()
        };
        let answers = SeriesVerdict {
            sentence: "Series of 3 epochs: it takes 4.".to_owned(),
            ..SeriesVerdict::default()
        };
        let verdict = Verdict::new(&Thresholds::default(), vec![on("B"), on("C <3>")]);
        write_json(&folder.path().join(VERDICT), &verdict.with_series(Some(answers))).unwrap();
        let estimate = |out: f64| EstimateRecord {
            value: [0.0, 0.0, out],
            sd: [1e-4, 1e-4, 2e-4],
        };
        let point = |(epoch, date, out): (&str, &str, f64)| PathPoint {
            epoch: epoch.to_owned(),
            date: date.to_owned(),
            measured: Some(estimate(out)),
            model: estimate(out),
        };
        let path = [("B", "2025-04-01", 0.001), ("C <3>", "2026-04-01", 0.002)].map(point);
        let group = |zone_id| ZoneTrend {
            epoch: "C <3>".to_owned(),
            zone_id,
            stones: 5,
            confirmed_by: Vec::new(),
            velocity: [0.0, 0.0, 0.001],
            sd: [1e-4; 3],
            level: None,
            temperature: None,
            season: None,
            path: path.to_vec(),
            curve: Vec::new(),
            departure: None,
        };
        let trends = TrendsRecord {
            version: TRENDS_VERSION,
            epochs: vec!["A".to_owned(), "B".to_owned(), "C <3>".to_owned()],
            undated: Vec::new(),
            terms: Vec::new(),
            basis: None,
            not_separable: Vec::new(),
            conditions: Vec::new(),
            variance_factors: None,
            wall: Some(group(0)),
            zones: vec![group(1)],
            answers: SeriesAnswers::default(),
        };
        write_json(&folder.path().join(TRENDS), &trends).unwrap();
        folder
    }

    #[test]
    fn a_series_has_a_yearly_report_in_the_order_of_authorities_and_its_tables() {
        let folder = series(Language::English);
        write_report(folder.path()).unwrap();
        let file = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let page = file("yearly.html");
        check_nesting(&page);
        let headings = [
            "What was measured",
            "Conditions</h2>",
            "Results</h2>",
            "Comparison with prediction",
            "Interpretation",
            "Conclusion",
            "Signature</h2>",
        ];
        let places: Vec<usize> = headings.iter().map(|h| page.find(h).unwrap()).collect();
        assert!(places.is_sorted(), "{places:?}");
        assert!(page.contains("C &lt;3&gt;") && !page.contains("<3>") && !page.contains("<script"));
        assert!(page.contains("temperature 9.5") && page.contains("it takes 4."));
        assert!(file("data/report_2.html").contains("href=\"../yearly.html\""));

        let paths = file("data/report/paths.csv");
        assert_eq!(paths.lines().count(), 1 + 2 * 2);
        let head: Vec<&str> = paths.lines().next().unwrap().split(',').collect();
        let out = head.iter().position(|c| *c == "out_m").unwrap();
        let cell = paths.lines().nth(4).unwrap().split(',').nth(out).unwrap();
        assert_eq!(cell.parse::<f64>().unwrap(), 0.002);
        assert_eq!(file("data/report/epochs.csv").lines().count(), 4);
        assert_eq!(file("data/report/answers.csv").lines().count(), 5);
        assert!(file("data/report/joints.csv").lines().count() > 10);

        let german = series(Language::German);
        write_report(german.path()).unwrap();
        let page = std::fs::read_to_string(german.path().join("yearly.html")).unwrap();
        assert!(page.contains("lang=\"de\"") && page.contains("6 Schlussfolgerung"));
    }

    #[test]
    fn an_unknown_datum_is_the_first_thing_said() {
        let folder = folder(&rows());
        let unknown = Datum::unknown(&nalgebra::Point3::origin(), "unknown".to_owned());
        let mut registration = RegistrationRecord {
            datum: unknown,
            observers: None,
            deformation: None,
            ..registration_record()
        };
        if let EstimatorRecord::Adjustment(adjustment) = &mut registration.estimator {
            adjustment.converged = true;
        }
        write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
        let html = std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap();
        let first = html.split("<ul class=\"findings\"><li>").nth(1).unwrap();
        assert!(
            first.starts_with("Registration error between the surveys is unknown and is <b>not</b> included")
        );
        let header = html.split("</header>").next().unwrap();
        assert!(header.contains("<p class=\"datum\">Registration error between the surveys is unknown"));
        assert!(html.contains("<b>Detection limit against the common motion: "));
    }

    #[test]
    fn a_run_in_doubt_gives_no_limits_and_no_intervals() {
        let page = |converged: bool| {
            let folder = folder(&rows());
            let mut registration = registration_record();
            if let EstimatorRecord::Adjustment(adjustment) = &mut registration.estimator {
                adjustment.converged = converged;
            }
            write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
            let html = std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap();
            // The terms are explained in either case.
            let body = html.split("<body>").nth(1).unwrap();
            body.split("<section id=\"method\">").next().unwrap().to_owned()
        };
        let [sound, doubtful] = [true, false].map(page);
        for claim in [
            "LoD95",
            "95 % limit",
            "class=\"faded\"",
            "elow their limit",
            "(95\u{a0}%: ",
        ] {
            assert!(sound.contains(claim) && !doubtful.contains(claim), "{claim}");
        }
        assert!(
            doubtful.contains("Detection limit: cannot be stated")
                && doubtful.contains("motions as computed")
        );
    }

    /// Results of a wall that settled, of which nothing moved but the stones of these ids.
    fn settled_results(moving: &[u32], params: &ReportParams) -> tempfile::TempDir {
        let mut stones = rows();
        for stone in &mut stones {
            if let Some(motion) = stone
                .motion
                .as_mut()
                .filter(|_| !moving.contains(&stone.stone_id))
            {
                motion.displacement *= 0.01;
                motion.relative *= 0.01;
                (motion.significant, motion.loose) = (false, false);
            }
            // Stone 3 is not lost: no photo shows its place.
            if stone.status == Status::UnmatchedLost {
                stone.status = Status::UnmatchedUnseen;
            }
        }
        let folder = folder(&stones);
        let mut registration = registration_record();
        if let EstimatorRecord::Adjustment(adjustment) = &mut registration.estimator {
            adjustment.converged = true;
        }
        write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
        let mut run = run_record("Wall", &["A", "B"]);
        run.parameters.report = params.clone();
        write_json(&folder.path().join(RUN), &run).unwrap();
        write_logo(folder.path(), &folder.path().join(RUN), "image/png").unwrap();
        folder
    }

    /// The report of them.
    fn settled(moving: &[u32], params: &ReportParams) -> String {
        let folder = settled_results(moving, params);
        let html = std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap();
        check_nesting(&html);
        html
    }

    /// A language that no file holds: the English texts, each between marks.
    fn marked() -> &'static Texts {
        fn mark(value: &mut Value) {
            match value {
                Value::String(text) => *text = format!("\u{27e6}{text}\u{27e7}"),
                Value::Array(list) => list.iter_mut().for_each(mark),
                Value::Object(table) => table.values_mut().for_each(mark),
                _ => {}
            }
        }
        let mut report: Value = Language::English.read("report");
        mark(&mut report);
        let mut texts = Texts::deserialize(&*Box::leak(Box::new(report))).unwrap();
        texts.decimal = ".";
        Box::leak(Box::new(texts))
    }

    /// The words of a page that stand outside the marks, without keys of files, names of these results, and units.
    fn unmarked(html: &str) -> BTreeSet<String> {
        let body = html.split("<body>").nth(1).unwrap();
        let body = body.split("<section id=\"audit\">").next().unwrap();
        let body = body.split("<script").next().unwrap();
        let after_code = |part: &str| {
            part.split_once("</code>")
                .map_or(part.to_owned(), |p| p.1.to_owned())
        };
        let body: String = body.split("<code>").map(after_code).collect();
        let (mut outside, mut depth, mut is_tag) = (String::new(), 0, false);
        for c in body.chars() {
            match c {
                '<' => is_tag = true,
                '>' => is_tag = false,
                _ if is_tag => {}
                '\u{27e6}' => depth += 1,
                '\u{27e7}' => depth -= 1,
                _ if depth == 0 => outside.push(c),
                _ => continue,
            }
            if is_tag || c == '>' {
                outside.push(' ');
            }
        }
        let words = outside.split(|c: char| !c.is_alphabetic());
        let names = [
            "Wall",
            "cameras",
            "xml",
            "cloud",
            "laz",
            "stonewise",
            "UTC",
            "mrad",
        ];
        let is_name = |word: &&str| word.len() < 3 || names.contains(word);
        words.filter(|word| !is_name(word)).map(str::to_owned).collect()
    }

    #[test]
    fn a_new_language_needs_nothing_but_its_texts() {
        let texts = marked();
        let sound = settled_results(&[8, 15], &ReportParams::default());
        let doubtful = folder(&rows());
        write_json(&doubtful.path().join(RUN), &run_record("Wall", &["A", "B"])).unwrap();
        let course = series(Language::English);
        let trends = std::fs::read(course.path().join(TRENDS)).unwrap();
        let trends: TrendsRecord = serde_json::from_slice(&trends).unwrap();
        let verdict = Verdict::new(&Thresholds::default(), Vec::new());
        let verdict = verdict.with_series(Some(crate::verdict::answers(&trends, texts)));
        write_json(&course.path().join(VERDICT), &verdict).unwrap();

        for (folder, converged) in [(&sound, true), (&doubtful, false), (&course, true)] {
            let mut registration = registration_record();
            if let EstimatorRecord::Adjustment(adjustment) = &mut registration.estimator {
                adjustment.converged = converged;
            }
            // What a run wrote in the language of its project.
            for check in &mut registration.checks {
                for text in [&mut check.what, &mut check.source] {
                    *text = format!("\u{27e6}{text}\u{27e7}");
                }
            }
            write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
            let results = ResultSet::read(folder.path()).unwrap();
            let results = ResultSet::read_pair(folder.path(), results.pairs).unwrap();
            let Summary {
                cover, mut profile, ..
            } = Summary::new(&results);
            profile.chapters.push(Chapter::Accuracy);
            let facts = Summary::of(&results, cover, profile, texts);
            let pages = [Some(page(&results, &facts).unwrap()), yearly(&results, &facts)];
            for html in pages.into_iter().flatten() {
                let words = unmarked(&html);
                assert!(html.contains('\u{27e6}') && words.is_empty(), "{words:?}");
            }
        }
    }

    #[test]
    fn a_still_wall_is_fine_and_the_page_never_says_that_a_stone_moved() {
        let html = settled(&[], &ReportParams::default());
        assert!(
            html.contains("<div class=\"verdict fine\"")
                && html.contains("Fine: no motion is shown; detection limit: 1.4\u{a0}mm (median)")
        );
        assert!(!html.contains("<p class=\"hedge\">"));
        assert!(html.contains("<b>0 <small>0\u{a0}%</small></b><span>moved (false discovery rate 5\u{a0}%)"));
        assert!(
            html.contains("No stone calls for a closer look.")
                && html.contains("<span>no motion is shown</span>")
        );
        let html = written(&html);
        for claim in ["moved significantly", "significant motion", "Largest motions"] {
            assert!(!html.contains(claim), "{claim}");
        }
    }

    #[test]
    fn the_first_page_names_who_measured_and_what_to_look_at_in_both_languages() {
        let params = ReportParams {
            operator: Some("River <Authority>".to_owned()),
            instruments: Some("Scanner X".to_owned()),
            calibration: Some("tested <2025>".to_owned()),
            reference_number: Some("T-17".to_owned()),
            ..ReportParams::default()
        };
        let html = settled(&[8, 15], &params);
        assert!(html.contains("Attention: 2 of 20 measured stones moved; the largest motion is 20."));
        for words in [
            "<dt>Reference number</dt><dd>T-17</dd>",
            "River &lt;Authority&gt;",
            "<dt>Calibration of the scanner</dt><dd>tested &lt;2025&gt;</dd>",
            "temperature 9.5\u{a0}\u{b0}C",
            "<a data-stone=\"15\">Stone 15</a>, 0.80\u{a0}m along, 0.50\u{a0}m up: moved 20.4\u{a0}mm",
            "4 of 24 stones were not measured",
            "<b>Detection limit: 1.4\u{a0}mm (median)</b>",
            "<p>Signature</p>",
            "src=\"data:image/png;base64,",
            // Two stones moved by 2 cm; the others are far below their limit of 1.4 mm.
            "<b>2 <small>10\u{a0}%</small></b><span>moved (false discovery rate 5\u{a0}%)",
            "Largest motions",
            "class=\"loose\"",
        ] {
            assert!(html.contains(words), "{words}");
        }
        let german = ReportParams {
            language: Language::German,
            ..params
        };
        let html = settled(&[8, 15], &german);
        assert!(html.starts_with("<!DOCTYPE html>\n<html lang=\"de\">"));
        for words in [
            "Aufmerksamkeit: 2 von 20 gemessenen Steinen haben sich bewegt",
            "Temperatur 9,5",
            "<p>Unterschrift</p>",
            "Nachweisgrenze: 1,4\u{a0}mm",
        ] {
            assert!(html.contains(words), "{words}");
        }
    }

    /// What stands in all elements of a name, without markup inside it.
    fn inside(html: &str, name: &str) -> Vec<String> {
        let (start, end) = (format!("<{name}"), format!("</{name}>"));
        let parts = html.split(&start).skip(1);
        parts
            .filter_map(|part| {
                let content = part.split_once('>')?.1.split(&end).next()?;
                let text: String = content
                    .split('<')
                    .map(|t| t.split_once('>').map_or(t, |t| t.1))
                    .collect();
                Some(text)
            })
            .collect()
    }

    #[test]
    fn a_german_report_has_no_english_heading() {
        let german = ReportParams {
            language: Language::German,
            ..ReportParams::default()
        };
        let languages = [ReportParams::default(), german];
        let in_doubt = languages.each_ref().map(|params| {
            let mut run = run_record("Wall", &["A", "B"]);
            run.parameters.report = params.clone();
            written(&report(&rows(), Some(&run)))
        });
        let sound = languages
            .each_ref()
            .map(|params| written(&settled(&[8, 15], params)));
        check_headings(&in_doubt);
        check_headings(&sound);
        // Numbers of tables and pictures.
        assert!(
            sound[1].contains("<td class=\"n\">20,4</td>") && !sound[1].contains("<td class=\"n\">20.4</td>")
        );
    }

    /// Every heading of the second page, which is German, differs from that of the first, which is English.
    fn check_headings(both: &[String; 2]) {
        // Names that are the same in both languages.
        let shared = [
            "Datum",
            "Parameter",
            "M3C2",
            "LoD95",
            "LoD95 mm",
            "NMAD mm",
            "RMSE mm",
            "3D mm",
            "status",
        ];
        for name in [
            "h2",
            "h3",
            "h4",
            "figcaption",
            "summary",
            "nav",
            "title",
            "th",
            "dt",
        ] {
            let [english, german] = both.each_ref().map(|html| {
                // The audit lists keys of run.json as they are.
                let listed = html.split("<section id=\"audit\">").next().unwrap();
                inside(
                    if ["th", "dt"].contains(&name) {
                        listed
                    } else {
                        html
                    },
                    name,
                )
            });
            assert_eq!(english.len(), german.len(), "{name}");
            for (e, g) in english.iter().zip(&german) {
                let is_shared = shared.iter().any(|word| g.eq_ignore_ascii_case(word)) || g.len() < 3;
                let is_key = g
                    .chars()
                    .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
                assert!(e != g || is_shared || (name == "dt" && is_key), "{name}: {g}");
            }
        }
    }

    /// Where the sections of a page are named, in its order.
    fn ids(html: &str) -> Vec<&str> {
        let sections = html.split("<section id=\"").skip(1);
        sections.filter_map(|part| part.split('"').next()).collect()
    }

    fn with_profile(profile: &str, language: Language) -> ReportParams {
        ReportParams {
            profile: profile.into(),
            language,
            ..ReportParams::default()
        }
    }

    #[test]
    fn a_profile_sets_the_order_and_the_headings() {
        let default = settled(&[8, 15], &ReportParams::default());
        assert_eq!(
            default,
            settled(&[8, 15], &with_profile("plain", Language::English))
        );
        let plain = "summary maps tables distributions datum checks method audit";
        assert_eq!(ids(&default).join(" "), plain);

        for (language, part) in [(Language::English, "Part"), (Language::German, "Teil")] {
            let params = with_profile("din19700", language);
            let html = settled(&[8, 15], &params);
            let order = "method datum accuracy summary maps tables distributions checks audit";
            assert_eq!(ids(&html).join(" "), order);
            let last = inside(&html, "h2").len() - 1;
            for (i, heading) in inside(&html, "h2").iter().enumerate() {
                let letter = if i < 3 { "A" } else { "B" };
                assert!(
                    i == last || heading.starts_with(&format!("{part} {letter}: ")),
                    "{heading}"
                );
            }
            assert!(inside(&html, "nav")[0].starts_with(&format!("{part} A: ")));

            let folder = series(language);
            let mut run: RunRecord =
                serde_json::from_slice(&std::fs::read(folder.path().join(RUN)).unwrap()).unwrap();
            run.parameters.report = params;
            write_json(&folder.path().join(RUN), &run).unwrap();
            write_report(folder.path()).unwrap();
            let yearly = std::fs::read_to_string(folder.path().join("yearly.html")).unwrap();
            check_nesting(&yearly);
            let numbers = inside(&yearly, "h2");
            let numbers: Vec<&str> = numbers.iter().map(|heading| &heading[..3]).collect();
            assert_eq!(numbers, ["A 1", "B 1", "B 2", "B 3", "B 4", "B 5", "B 6"]);
        }
    }

    #[test]
    fn a_profile_of_ones_own_is_read_from_the_results() {
        let folder = settled_results(&[], &with_profile("survey/ours.toml", Language::English));
        let file = folder.path().join("ours.toml");
        let text = "chapters = [\"checks\"]\nappendix = [\"summary\"]\nyearly = []\n\
                    [words.en.checks]\nheading = \"What could be wrong\"\n";
        std::fs::write(&file, text).unwrap();
        write_json(&folder.path().join(PROFILE), &Profile::read(&file).unwrap()).unwrap();
        let page = || std::fs::read_to_string(write_report(folder.path()).unwrap()).unwrap();
        let html = page();
        check_nesting(&html);
        assert_eq!(ids(&html), ["checks", "summary"]);
        assert_eq!(inside(&html, "h2"), ["What could be wrong", "Summary"]);

        std::fs::write(folder.path().join(PROFILE), text).unwrap();
        let message = write_report(folder.path()).unwrap_err().to_string();
        assert!(message.contains("profile.json"), "{message}");
    }

    #[test]
    fn a_folder_without_results_says_what_to_give() {
        let folder = tempfile::tempdir().unwrap();
        let message = write_report(folder.path()).unwrap_err().to_string();
        assert!(message.contains("stonewise run"), "{message}");
    }
}
