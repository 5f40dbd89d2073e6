//! Other instruments beside the stones around them.

use super::html::{section, table, with_units};
use super::pair::epoch_names;
use crate::texts::{InstrumentTexts, Texts, fill};
use std::fmt::Write;
use stonewise_figure::{escape, number};
use stonewise_results::ResultSet;
use stonewise_results::records::{ComparedInstrument, DatumUse, InstrumentsEpoch, WhyLeftOut};

/// Half the width of a normal 95 % interval in standard deviations.
const Z: f64 = 1.96;

/// The section on the instruments of this epoch; empty where the project names none.
pub(super) fn instruments(results: &ResultSet, texts: &Texts) -> String {
    let body = compared(results, texts);
    match body.is_empty() {
        true => body,
        false => section("instruments", texts.instruments.heading, &body),
    }
}

/// What the section says.
pub(super) fn compared(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.instruments;
    let later = results
        .run
        .as_ref()
        .and_then(|run| epoch_names(run, results.pair));
    let Some(found) = results
        .instruments
        .iter()
        .flat_map(|i| &i.epochs)
        .find(|e| later.as_ref().is_some_and(|[_, later]| *later == e.epoch))
    else {
        return String::new();
    };
    let mut body = String::new();
    if !found.compared.is_empty() {
        let _ = write!(body, "<p>{}</p>", with_units(names.intro));
        let rows: Vec<Vec<String>> = found.compared.iter().map(|c| row(c, texts)).collect();
        body.push_str(&table(&names.columns, &rows, 1));
    }
    let mut notes: Vec<String> = Vec::new();
    notes.extend(found.p.map(|p| {
        let p = number(p, if p < 0.01 { 4 } else { 2 }).replace('.', texts.decimal);
        fill(names.together, &[("p", &*p)])
    }));
    notes.extend(found.datum.map(|datum| said(datum, names).to_owned()));
    notes.extend(left_out(found, texts));
    if !notes.is_empty() {
        let _ = write!(body, "<p class=\"note\">{}</p>", notes.join(" "));
    }
    body
}

fn row(found: &ComparedInstrument, texts: &Texts) -> Vec<String> {
    let three = |values: [Option<f64>; 3]| {
        let cell = |v: Option<f64>| v.map_or("\u{2013}".to_owned(), |v| texts.mm(v));
        values.map(cell).join(" / ")
    };
    let with_half = [0, 1, 2].map(|axis| {
        let (value, sd) = (found.difference_m[axis], found.difference_sd_m[axis]);
        match value.zip(sd) {
            Some((value, sd)) => format!("{} \u{b1} {}", texts.mm(value), texts.mm(Z * sd)),
            None => "\u{2013}".to_owned(),
        }
    });
    vec![
        escape(&found.name),
        three(found.motion_m),
        three(found.stones_m.map(Some)),
        with_half.join(" / "),
        texts.instruments.words[match found.agrees {
            Some(true) => 0,
            Some(false) => 1,
            None => 2,
        }]
        .to_owned(),
    ]
}

fn said(datum: DatumUse, names: &InstrumentTexts) -> &'static str {
    names.uses[match datum {
        DatumUse::Observed => 0,
        DatumUse::Undetermined => 1,
        DatumUse::Contradicted => 2,
    }]
}

fn left_out(found: &InstrumentsEpoch, texts: &Texts) -> Option<String> {
    let names = &texts.instruments;
    let why = |why: &WhyLeftOut| match why {
        WhyLeftOut::NoDate => names.no_date.to_owned(),
        WhyLeftOut::BeforeReadings => names.before.to_owned(),
        WhyLeftOut::AfterReadings => names.after.to_owned(),
        WhyLeftOut::Gap { days } => fill(names.gap, &[("days", &*number(*days, 0))]),
        WhyLeftOut::NoStones { reach_m } => {
            let reach = number(*reach_m, 1).replace('.', texts.decimal);
            fill(names.no_stones, &[("reach", &*reach)])
        }
    };
    let list = found
        .left_out
        .iter()
        .map(|l| format!("{} ({})", escape(&l.name), why(&l.why)));
    let list: Vec<String> = list.collect();
    (!list.is_empty()).then(|| fill(names.not_compared, &[("list", &*list.join(", "))]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, rows, run_record};
    use stonewise_base::report_params::Language;
    use stonewise_results::records::{InstrumentsRecord, LeftOutInstrument};

    #[test]
    fn instruments_stand_beside_their_stones_and_gaps_have_reasons() {
        let folder = folder(&rows());
        let mut results = ResultSet::read(folder.path()).unwrap();
        assert!(instruments(&results, Texts::of(Language::English)).is_empty());
        results.run = Some(run_record("Wall", &["A", "B"]));
        let compared = ComparedInstrument {
            name: "T<1>".to_owned(),
            file: "targets.csv".to_owned(),
            place: [0.0; 3],
            motion_m: [Some(0.001), None, Some(-0.002)],
            sd_m: [Some(3e-4), None, Some(3e-4)],
            stones: vec![1, 2, 3],
            distance_m: 0.2,
            stones_m: [0.0045, 0.0, -0.002],
            difference_m: [Some(0.0035), None, Some(0.0)],
            difference_sd_m: [Some(0.0005), None, Some(0.0005)],
            p: Some(1e-6),
            agrees: Some(false),
            is_used: true,
        };
        let epoch = InstrumentsEpoch {
            epoch: "B".to_owned(),
            p: Some(0.0002),
            compared: vec![compared],
            left_out: vec![LeftOutInstrument {
                name: "P9".to_owned(),
                file: "targets.csv".to_owned(),
                why: WhyLeftOut::Gap { days: 200.0 },
            }],
            datum: Some(DatumUse::Contradicted),
        };
        results.instruments = Some(InstrumentsRecord {
            version: 1,
            epochs: vec![epoch],
        });
        let english = instruments(&results, Texts::of(Language::English));
        for part in [
            "T&lt;1&gt;",
            "1.0 / \u{2013} / \u{2212}2.0",
            "3.5 \u{b1} 0.98 / \u{2013} / 0.0 \u{b1} 0.98",
            "<td class=\"n\">no</td>",
            "0.0002",
            "P9 (readings 200 days apart)",
            "contradict each other",
        ] {
            assert!(english.contains(part), "{part}: {english}");
        }
        let german = instruments(&results, Texts::of(Language::German));
        assert!(
            german.contains("3,5 \u{b1} 0,98") && german.contains("0,0002"),
            "{german}"
        );
    }
}
