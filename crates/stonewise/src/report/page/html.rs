//! Small pieces of HTML.

use crate::figure::escape;
use std::fmt::Write;

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

/// A figure; the picture is SVG or HTML already, the note HTML.
pub(super) fn figure(title: &str, picture: &str, note: &str) -> String {
    let note = if note.is_empty() {
        String::new()
    } else {
        format!("<p class=\"note\">{note}</p>")
    };
    format!(
        "<figure><figcaption>{}</figcaption>{picture}{note}</figure>\n",
        escape(title)
    )
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
