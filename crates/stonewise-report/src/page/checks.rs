//! The checks that can put the results as a whole in doubt, whether they passed or not.

use super::first_page::with_code;
use super::html::{section, table};
use super::influence::influence;
use crate::texts::{Texts, fill};
use stonewise_figure::escape;
use stonewise_results::ResultSet;
use stonewise_results::records::CheckRecord;

/// The tables of the checks and of what the results rest on; empty where none is recorded.
pub(super) fn checks(results: &ResultSet, texts: &Texts) -> String {
    let checks = results
        .registration
        .as_ref()
        .map_or(&[][..], |r| r.checks.as_slice());
    let names = &texts.checks;
    let rows: Vec<Vec<String>> = checks.iter().map(|check| row(check, texts)).collect();
    let head = [
        names.check,
        names.epoch,
        names.value,
        names.limit,
        names.source,
        names.outcome,
    ];
    let checks = match rows.is_empty() {
        true => String::new(),
        false => format!("<p>{}</p>{}", names.intro, table(&head, &rows, head.len())),
    };
    match checks + &influence(results, texts) {
        body if body.is_empty() => body,
        body => section("checks", names.heading, &body),
    }
}

fn row(check: &CheckRecord, texts: &Texts) -> Vec<String> {
    let names = &texts.checks;
    let limit = match check.at_least {
        true => names.at_least,
        false => names.at_most,
    };
    let outcome = match &check.remedy {
        Some(remedy) => {
            let colon = texts.language.text("language.colon");
            format!("<b>{}</b>{colon}{}", names.failed, with_code(remedy))
        }
        None => names.passed.to_owned(),
    };
    vec![
        escape(&check.what),
        escape(&check.epoch),
        short(check.statistic, texts),
        fill(limit, &[("limit", &*short(check.limit, texts))]),
        escape(&check.source),
        outcome,
    ]
}

/// A number with three significant digits, without zeros at its end.
fn short(value: f64, texts: &Texts) -> String {
    let rounded = format!("{value:.2e}").parse().unwrap_or(value);
    f64::to_string(&rounded).replace('.', texts.decimal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, registration_record, rows};
    use stonewise_base::files::write_json;
    use stonewise_base::report_params::Language;
    use stonewise_results::records::RegistrationRecord;

    #[test]
    fn checks_are_listed_and_those_that_failed_say_what_to_do() {
        let check = |statistic: f64, remedy: Option<&str>| CheckRecord {
            name: "insensitive".to_owned(),
            what: "limit of <detection>".to_owned(),
            epoch: "2026".to_owned(),
            statistic,
            limit: 100.0,
            at_least: false,
            source: "something else hides the motions".to_owned(),
            passed: remedy.is_none(),
            remedy: remedy.map(str::to_owned),
        };
        let folder = folder(&rows());
        let page = |checks: Vec<CheckRecord>| {
            let registration = RegistrationRecord {
                checks,
                ..registration_record()
            };
            write_json(&folder.path().join("data/registration.json"), &registration).unwrap();
            checks_of(&ResultSet::read(folder.path()).unwrap())
        };
        assert_eq!(page(Vec::new()), "");
        let html = page(vec![check(1.2345, None), check(1234.0, Some("Run `check`"))]);
        for words in [
            "<td>limit of &lt;detection&gt;</td><td>2026</td><td>1,23</td><td>höchstens 100</td>",
            "<td>bestanden</td>",
            "<td>1230</td>",
            "<td><b>nicht bestanden</b>: Run <code>check</code></td>",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
    }

    fn checks_of(results: &ResultSet) -> String {
        checks(results, Texts::of(Language::German))
    }
}
