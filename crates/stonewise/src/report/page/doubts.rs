//! What must be read before anything else.

use crate::figure::escape;
use crate::warnings::Warning;
use std::fmt::Write;

/// Why the results as a whole cannot be relied on; empty where nothing is doubted.
pub(super) fn doubts(warnings: &[Warning]) -> String {
    let all: Vec<&Warning> = warnings.iter().filter(|w| w.doubt).collect();
    if all.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "<div role=\"alert\" style=\"border:3px solid #b3261e;padding:10px 16px;margin:0 0 18px\">\
         <b>These results must not be relied on as they stand.</b><ul>",
    );
    for warning in all {
        let _ = write!(
            out,
            "<li>{}: {}</li>",
            escape(&warning.subject),
            escape(&warning.message)
        );
    }
    out.push_str("</ul></div>");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warnings::Warnings;

    #[test]
    fn doubts_are_named_and_other_warnings_are_not() {
        let warnings = Warnings::default();
        warnings.skipped("segment", "a.jpg", "cut off");
        assert_eq!(doubts(&warnings.sorted()), "");
        warnings.doubt("register", "<2026>", "did not converge");
        let html = doubts(&warnings.sorted());
        assert!(html.contains("<li>&lt;2026&gt;: did not converge</li>") && !html.contains("cut off"));
    }
}
