//! Required and achieved accuracy, and the budget of uncertainty of the largest motion.

use super::html::{section, table};
use crate::summary::Summary;
use crate::texts::fill;
use stonewise_base::thresholds::{Quantity, Threshold};
use stonewise_figure::count;
use stonewise_results::records::DatumState;
use stonewise_results::{ResultSet, RowMotion, Sorted, StoneRow, Term};

/// Half the width of a 95 % interval, standard deviations.
const COVERAGE: f64 = 1.96;

/// The two tables; results in doubt have no accuracy.
pub(super) fn accuracy(results: &ResultSet, facts: &Summary) -> String {
    let texts = facts.texts;
    let body = match facts.verdict.is_sound() {
        true => format!("{}{}", required(results, facts), budget(results, facts)),
        false => format!("<p>{}</p>", texts.page.limit_unknown),
    };
    section("accuracy", texts.accuracy.heading, &body)
}

/// The smallest threshold of each motion of a stone, and the motions that the stones would show.
fn required(results: &ResultSet, facts: &Summary) -> String {
    let (texts, names) = (facts.texts, &facts.texts.accuracy);
    let thresholds = results.thresholds();
    let row = |quantity: Quantity, achieved_m: &dyn Fn(&RowMotion) -> f64| {
        let required_mm = |stone: &StoneRow| {
            let zone = thresholds.zone_at(&results.facade.place(&stone.centroid));
            let limits = thresholds.of(quantity, zone).map(|t: Threshold| t.limit.abs());
            limits.reduce(f64::min)
        };
        let of_stones: Vec<(f64, Option<f64>)> = { facts.measured.iter() }
            .map(|(stone, motion)| (achieved_m(motion), required_mm(stone)))
            .collect();
        let achieved = Sorted::new(of_stones.iter().map(|(achieved, _)| *achieved));
        let limits = of_stones
            .iter()
            .filter_map(|(achieved, limit)| Some((achieved, (*limit)?)));
        let smallest = limits.clone().map(|(_, limit)| limit).reduce(f64::min);
        let kept = limits
            .clone()
            .filter(|(achieved, limit)| 1e3 * **achieved <= *limit);
        let kept = [("n", &*count(kept.count())), ("m", &*count(limits.count()))];
        vec![
            texts.clauses.quantities[quantity as usize].to_owned(),
            smallest.map_or(names.none_stated.to_owned(), |mm| texts.limit(quantity, mm)),
            texts.mm_or_dash(achieved.median()),
            texts.mm_or_dash(achieved.quantile(0.9)),
            smallest.map_or("\u{2013}".to_owned(), |_| fill(texts.yearly.of, &kept)),
        ]
    };
    let rows = [
        row(Quantity::Length, &|m| m.detection_limit_m),
        row(Quantity::Along, &|m| COVERAGE * m.face_sd.x),
        row(Quantity::Up, &|m| COVERAGE * m.face_sd.y),
        row(Quantity::Out, &|m| COVERAGE * m.face_sd.z),
    ];
    format!("<p>{}</p>{}", names.intro, table(&names.columns, &rows, 2))
}

/// The budget of the stone that moved farthest, or, where none moved, of the largest motion that was measured (JCGM
/// 100:2008, 4.3 and 5.1.2); empty where results of an earlier version have none.
fn budget(results: &ResultSet, facts: &Summary) -> String {
    let (texts, names) = (facts.texts, &facts.texts.accuracy);
    let length = |(_, motion): &(&StoneRow, &RowMotion)| motion.displacement.norm();
    let farthest = || {
        facts
            .measured
            .iter()
            .max_by(|a, b| length(a).total_cmp(&length(b)))
    };
    let Some((stone, motion)) = facts.moved.first().or_else(farthest) else {
        return String::new();
    };
    let total = motion.budget.total();
    let state = results.datum().map(|datum| datum.state);
    let mut rows: Vec<Vec<String>> = { motion.budget.sds() }
        .map(|(term, sd)| {
            let share = motion.budget.variances(term).sum() / total.sum();
            vec![
                texts.terms[term as usize].to_owned(),
                kind(term, state).to_owned(),
                texts.mm(sd.x),
                texts.mm(sd.y),
                texts.mm(sd.z),
                format!("{}\u{a0}%", texts.number(1e2 * share, 0)),
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    for (name, factor) in [(names.combined, 1.0), (names.expanded, COVERAGE)] {
        let [along, up, out] = [0, 1, 2].map(|k| texts.mm(factor * total[k].max(0.0).sqrt()));
        rows.push(vec![
            format!("<b>{name}</b>"),
            String::new(),
            along,
            up,
            out,
            String::new(),
        ]);
    }
    let id = stone.stone_id.to_string();
    let values = [("id", &*id), ("length", &*texts.mm(motion.displacement.norm()))];
    format!(
        "<h3>{}</h3>{}<p class=\"note\">{}</p>",
        fill(names.budget, &values),
        table(&names.budget_columns, &rows, 2),
        names.budget_note
    )
}

/// How a term is evaluated: A, from the scatter of the survey itself; B, from what is stated or assumed.
fn kind(term: Term, datum: Option<DatumState>) -> &'static str {
    match term {
        Term::Stone | Term::Points | Term::CommonMotion => "A",
        Term::Scale => "B",
        Term::Registration if datum == Some(DatumState::Stated) => "B",
        Term::Registration | Term::Poses | Term::Photos => "A, B",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, registration_record, rows, run_record};
    use nalgebra::Vector3;
    use serde_json::json;
    use stonewise_base::files::write_json;
    use stonewise_base::thresholds::Thresholds;
    use stonewise_results::Budget;
    use stonewise_results::names::{RUN, VERDICT};
    use stonewise_results::records::{EstimatorRecord, Verdict};

    /// The chapter for stones with detection limits of 1.4 mm and standard deviations of 0.5 mm along each axis.
    fn page(thresholds: serde_json::Value, converged: bool) -> String {
        let mut stones = rows();
        let sds = [
            (Term::Stone, Vector3::new(3e-4, 4e-4, 0.0)),
            (Term::Registration, Vector3::new(4e-4, 3e-4, 1.2e-3)),
        ];
        for motion in stones.iter_mut().filter_map(|s| s.motion.as_mut()) {
            motion.budget = Budget::from_sds(sds);
        }
        let folder = folder(&stones);
        let mut registration = registration_record();
        if let EstimatorRecord::Adjustment(adjustment) = &mut registration.estimator {
            adjustment.converged = converged;
        }
        write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
        write_json(&folder.path().join(RUN), &run_record("Wall", &["A", "B"])).unwrap();
        let thresholds: Thresholds = serde_json::from_value(thresholds).unwrap();
        let verdict = Verdict::new(&thresholds, Vec::new());
        write_json(&folder.path().join(VERDICT), &verdict).unwrap();
        let results = ResultSet::read(folder.path()).unwrap();
        accuracy(&results, &Summary::new(&results))
    }

    #[test]
    fn a_requirement_is_what_the_project_states_and_nothing_else() {
        let html = page(json!({}), true);
        assert_eq!(html.matches("<td class=\"n\">\u{2013}</td>").count(), 4);
        assert_eq!(html.matches("<td>the project states none</td>").count(), 4);

        let html = page(json!({ "alarm_mm": 1.0, "out_alarm_mm": [-2.0, 3.0] }), true);
        let row = |name: &str| {
            html.split(name)
                .nth(1)
                .unwrap()
                .split("</tr>")
                .next()
                .unwrap()
                .to_owned()
        };
        let out = row("<td>out of the wall</td>");
        assert!(
            out.contains("<td>2 mm</td>") && out.contains(">0.98</td>"),
            "{out}"
        );
        assert!(out.contains(">20 of 20</td>"), "{out}");
        assert!(
            html.contains(">0 of 20</td>") && html.contains("<td>1 mm</td>"),
            "{html}"
        );
        assert_eq!(html.matches("<td>the project states none</td>").count(), 2);
    }

    /// Variances along, up and out: 9 + 16, 16 + 9 and 144, of which the stone has 25 of 194 (in 1e-8 m^2).
    #[test]
    fn the_budget_adds_up() {
        let html = page(json!({}), true);
        for words in [
            "stone 15, 20.4 mm",
            "<td>A</td><td class=\"n\">0.30</td><td class=\"n\">0.40</td><td class=\"n\">0.0</td><td class=\"n\">13\u{a0}%</td>",
            "<td>A, B</td><td class=\"n\">0.40</td><td class=\"n\">0.30</td><td class=\"n\">1.2</td><td class=\"n\">87\u{a0}%</td>",
            "<td class=\"n\">0.50</td><td class=\"n\">0.50</td><td class=\"n\">1.2</td>",
            "<td class=\"n\">0.98</td><td class=\"n\">0.98</td><td class=\"n\">2.4</td>",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
        assert!(!page(json!({}), false).contains("<table>"));
    }
}
