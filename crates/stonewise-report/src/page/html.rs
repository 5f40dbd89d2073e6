//! Small pieces of HTML.

use std::fmt::Write;
use stonewise_figure::escape;

/// A table; cells are HTML already. Columns from `numbers_from` on are aligned as numbers.
pub(super) fn table(head: &[&str], rows: &[Vec<String>], numbers_from: usize) -> String {
    let mut out = String::from("<div class=\"scroll\"><table><thead><tr>");
    let class = |i: usize| if i >= numbers_from { " class=\"n\"" } else { "" };
    for (i, name) in head.iter().enumerate() {
        let _ = write!(out, "<th scope=\"col\"{}>{}</th>", class(i), escape(name));
    }
    out.push_str("</tr></thead><tbody>");
    for row in rows {
        out.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let _ = write!(out, "<td{}>{cell}</td>", class(i));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>");
    out
}

/// A figure; the picture is SVG or HTML already, the note HTML. A picture that is wider than a phone is scrolled.
pub(super) fn figure(title: &str, picture: &str, note: &str) -> String {
    let note = if note.is_empty() {
        String::new()
    } else {
        format!("<p class=\"note\">{note}</p>")
    };
    format!(
        "<figure><figcaption>{}</figcaption><div class=\"scroll\">{picture}</div>{note}</figure>\n",
        escape(title)
    )
}

/// A text whose numbers and units stay in one line, "95-%-" as well.
pub(super) fn with_units(text: &str) -> String {
    const UNITS: [&str; 5] = ["mm", "cm", "m", "s", "%"];
    let mut out = String::with_capacity(text.len());
    for (i, word) in text.split(' ').enumerate() {
        let bare = word.trim_end_matches(|c: char| !c.is_alphanumeric() && c != '%');
        let before = out.strip_suffix("</b>").unwrap_or(&out);
        let is_unit = UNITS.contains(&bare) && before.ends_with(|c: char| c.is_ascii_digit());
        if i > 0 {
            out.push(if is_unit { '\u{a0}' } else { ' ' });
        }
        out.push_str(&word.replace("-%", "-\u{2060}%"));
    }
    out
}

/// A section with its heading.
pub(super) fn section(id: &str, title: &str, body: &str) -> String {
    format!(
        "<section id=\"{id}\"><h2>{}</h2>\n{body}</section>\n",
        escape(title)
    )
}

/// A part that can be folded; open on paper.
pub(super) fn details(title: &str, body: &str) -> String {
    format!("<details><summary>{}</summary>{body}</details>\n", escape(title))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_stays_beside_its_unit() {
        let text = "moved by 30.3 mm (95 % interval 29.4 to 31.1 mm), 5 mm; 2,0 mm (90. Perzentil), 3 m up";
        let kept = with_units(text);
        assert_eq!(
            kept,
            "moved by 30.3\u{a0}mm (95\u{a0}% interval 29.4 to 31.1\u{a0}mm), 5\u{a0}mm; 2,0\u{a0}mm (90. Perzentil), 3\u{a0}m up"
        );
        assert_eq!(kept.replace('\u{a0}', " "), text);
        assert_eq!(with_units("Fine: no m 5 motions"), "Fine: no m 5 motions");
        assert_eq!(
            with_units("<b>5.0</b> mm, <b>a</b> mm"),
            "<b>5.0</b>\u{a0}mm, <b>a</b> mm"
        );
        assert_eq!(with_units("(95-%-Intervall"), "(95-\u{2060}%-Intervall");
    }
}
