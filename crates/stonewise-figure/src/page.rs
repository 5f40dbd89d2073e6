//! A self-contained page of text, tables and pictures.

use super::escape;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

/// A page that is being written, HTML.
#[derive(Clone, Debug, Default)]
pub struct Page {
    title: String,
    body: String,
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1240px;margin:1.5rem auto;padding:0 1rem;color:#222;\
background:#fff}h1{font-size:1.6rem}h2{font-size:1.2rem;margin-top:2rem}figure{margin:1rem 0;display:inline-block;\
vertical-align:top;max-width:100%}figcaption{font-weight:600;margin-bottom:.3rem}p.note{color:#555;max-width:60rem}\
table{border-collapse:collapse;margin:.6rem 0}th,td{padding:.2rem .7rem;border-bottom:1px solid #ddd;text-align:right}\
th:first-child,td:first-child,.words th,.words td{text-align:left}thead th{border-bottom:2px solid #888}.scroll{overflow-x:auto}\
pre{background:#f4f4f4;padding:.7rem;overflow-x:auto}svg,img{max-width:100%;height:auto}tr.best td{background:#e8f3e8}";

impl Page {
    /// An empty page.
    pub fn new(title: &str) -> Self {
        Self {
            title: title.to_owned(),
            body: String::new(),
        }
    }

    /// A heading.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        let _ = writeln!(self.body, "<h2>{}</h2>", escape(text));
        self
    }

    /// A paragraph of plain text.
    pub fn note(&mut self, text: &str) -> &mut Self {
        let _ = writeln!(self.body, "<p class=\"note\">{}</p>", escape(text));
        self
    }

    /// Text as it is, in a box.
    pub fn code(&mut self, text: &str) -> &mut Self {
        let _ = writeln!(self.body, "<pre>{}</pre>", escape(text));
        self
    }

    /// HTML that was made by [`table`] or a plot.
    pub fn html(&mut self, html: &str) -> &mut Self {
        let _ = writeln!(self.body, "{html}");
        self
    }

    /// A picture (SVG or HTML) under its caption.
    pub fn figure(&mut self, caption: &str, picture: &str) -> &mut Self {
        let _ = writeln!(
            self.body,
            "<figure><figcaption>{}</figcaption>{picture}</figure>",
            escape(caption)
        );
        self
    }

    /// The whole page.
    pub fn finish(&self) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
             content=\"width=device-width\"><title>{0}</title><style>{STYLE}</style></head>\n<body><h1>{0}</h1>\n{1}</body></html>\n",
            escape(&self.title),
            self.body
        )
    }
}

/// A table of numbers, with names in its first column; rows whose number is `best` stand out.
pub fn table(head: &[&str], rows: &[Vec<String>], best: Option<usize>) -> String {
    table_of_class("numbers", head, rows, best)
}

/// A table of words.
pub fn words(head: &[&str], rows: &[Vec<String>]) -> String {
    table_of_class("words", head, rows, None)
}

fn table_of_class(class: &str, head: &[&str], rows: &[Vec<String>], best: Option<usize>) -> String {
    let mut out = format!("<div class=\"scroll\"><table class=\"{class}\"><thead><tr>");
    for name in head {
        let _ = write!(out, "<th>{}</th>", escape(name));
    }
    out.push_str("</tr></thead><tbody>");
    for (i, row) in rows.iter().enumerate() {
        out.push_str(if best == Some(i) {
            "<tr class=\"best\">"
        } else {
            "<tr>"
        });
        for cell in row {
            let _ = write!(out, "<td>{}</td>", escape(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>");
    out
}

/// A JPEG inside the page.
pub fn jpeg_element(jpeg: &[u8], description: &str) -> String {
    format!(
        "<img alt=\"{}\" src=\"data:image/jpeg;base64,{}\">",
        escape(description),
        STANDARD.encode(jpeg)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number;

    #[test]
    fn words_stand_on_the_left_and_numbers_on_the_right() {
        let rows = [vec!["all".to_owned(), "<ok>".to_owned()]];
        let (of_words, of_numbers) = (
            words(&["epoch", "what"], &rows),
            table(&["epoch", "mm"], &rows, Some(0)),
        );
        assert!(of_words.contains("<table class=\"words\"><thead><tr><th>epoch</th><th>what</th>"));
        assert!(of_words.contains("<td>&lt;ok&gt;</td>") && !of_words.contains("best"));
        assert!(of_numbers.contains("class=\"numbers\"") && of_numbers.contains("<tr class=\"best\">"));
        let page = Page::new("a").finish();
        assert!(page.contains("text-align:right") && page.contains(".words td{text-align:left}"));
    }

    #[test]
    fn text_is_harmless_and_numbers_read_well() {
        let mut page = Page::new("<b>");
        page.note("a < b").figure("\"x\"", "<svg/>");
        let html = page.finish();
        assert!(html.contains("&lt;b&gt;") && html.contains("a &lt; b") && html.contains("<svg/>"));
        assert_eq!(number(-0.004, 2), "0.00");
        assert_eq!(number(-1.5, 1), "\u{2212}1.5");
        assert_eq!(number(f64::NAN, 1), "–");
    }
}
