//! What the results rest on: reliability, and the motions without each source, stable area, instrument and length.

use super::html::table;
use crate::texts::Texts;
use stonewise_figure::escape;
use stonewise_results::ResultSet;
use stonewise_results::records::InfluenceRecord;

/// The table under its heading; empty where nothing checks anything.
pub(super) fn influence(results: &ResultSet, texts: &Texts) -> String {
    let registration = results.registration.as_ref();
    let all = registration.map_or(&[][..], |r| r.influence.as_slice());
    if all
        .iter()
        .all(|i| i.smallest_blunder_mm.is_none() && i.shift_mm.is_none())
    {
        return String::new();
    }
    let names = &texts.influence;
    let mm = |value: Option<f64>| texts.mm_or_dash(value.map(|mm| mm / 1e3));
    let row = |i: &InfluenceRecord| {
        vec![
            escape(&i.name),
            format!("{:.1}", i.redundancy).replace('.', texts.decimal),
            mm(i.smallest_blunder_mm),
            mm(i.largest_motion_without_mm),
            mm(i.shift_mm),
        ]
    };
    let rows: Vec<Vec<String>> = all.iter().map(row).collect();
    let head = [
        names.name,
        names.redundancy,
        names.blunder,
        names.without,
        names.shift,
    ];
    format!(
        "<h3>{}</h3><p>{}</p>{}",
        names.heading,
        names.intro,
        table(&head, &rows, 1)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, registration_record, rows};
    use stonewise_base::files::write_json;
    use stonewise_base::report_params::Language;
    use stonewise_results::records::RegistrationRecord;

    #[test]
    fn what_the_results_rest_on_is_a_table_if_anything_checks_it() {
        let record = |name: &str, blunder, without, shift| InfluenceRecord {
            name: name.to_owned(),
            redundancy: 12.5,
            smallest_blunder_mm: blunder,
            largest_motion_without_mm: without,
            shift_mm: shift,
        };
        let folder = folder(&rows());
        let page = |influence: Vec<InfluenceRecord>| {
            let registration = RegistrationRecord {
                influence,
                ..registration_record()
            };
            write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
            let results = ResultSet::read(folder.path()).unwrap();
            super::influence(&results, Texts::of(Language::German))
        };
        assert_eq!(page(vec![record("2025: whole", None, None, None)]), "");
        let html = page(vec![
            record("<2026>: 3", Some(2.125), Some(12.4), Some(0.5)),
            record("2025: 1", Some(1.0), None, None),
        ]);
        let cells = |name: &str, others: &[&str]| {
            let others: String = others
                .iter()
                .map(|cell| format!("<td class=\"n\">{cell}</td>"))
                .collect();
            format!("<td>{name}</td>{others}")
        };
        let texts = Texts::of(Language::German);
        let [blunder, without, shift] = [2.125e-3, 12.4e-3, 0.5e-3].map(|m| texts.mm(m));
        let first = cells("&lt;2026&gt;: 3", &["12,5", &blunder, &without, &shift]);
        assert!(html.contains(&first), "{html}");
        assert!(html.matches("<tr>").count() == 3, "{html}");
    }
}
