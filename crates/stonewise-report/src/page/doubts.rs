//! What must be read before anything else.

use super::first_page::said;
use crate::texts::Texts;
use std::fmt::Write;
use stonewise_base::warnings::Warning;
use stonewise_figure::escape;

/// Why the results as a whole cannot be relied on; empty where nothing is doubted.
pub(super) fn doubts(warnings: &[Warning], texts: &Texts) -> String {
    let all: Vec<&Warning> = warnings.iter().filter(|w| w.doubt).collect();
    if all.is_empty() {
        return String::new();
    }
    let mut out = format!(
        "<div role=\"alert\" class=\"doubts\"><b>{}</b><ul>",
        texts.page.doubts
    );
    for warning in all {
        let message = said(&warning.message, &warning.translations, texts);
        let colon = texts.language.text("language.colon");
        let _ = write!(out, "<li>{}{colon}{message}</li>", escape(&warning.subject));
    }
    out.push_str("</ul></div>");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_base::messages::{CAUSE_OPEN, NOT_CONVERGED};
    use stonewise_base::report_params::Language;
    use stonewise_base::warnings::Warnings;

    #[test]
    fn doubts_are_named_and_other_warnings_are_not() {
        let warnings = Warnings::default();
        warnings.skipped("segment", "a.jpg", "cut off");
        let texts = Texts::of(Language::English);
        assert_eq!(doubts(&warnings.sorted(), texts), "");
        warnings.doubt("register", "<2026>", "did not converge");
        let html = doubts(&warnings.sorted(), texts);
        assert!(html.contains("<li>&lt;2026&gt;: did not converge</li>") && !html.contains("cut off"));
        let german = Texts::of(Language::German);
        let html = doubts(&warnings.sorted(), german);
        assert!(html.contains("<li>&lt;2026&gt;: <span lang=\"en\">did not converge</span></li>"));
        warnings.doubt(
            "register",
            "2027",
            NOT_CONVERGED.say(&[("iterations", "30".into()), ("cause", (&CAUSE_OPEN).into())]),
        );
        let html = doubts(&warnings.sorted(), german);
        assert!(html.contains("<li>2027: die Ausgleichung ist in 30 Iterationen nicht konvergiert"));
        assert!(
            html.contains("ohne Fotos lässt sich das nicht entscheiden"),
            "{html}"
        );
    }
}
