//! The certificate as a page that prints.

use super::certificate::{Certificate, Figure};
use crate::error::Result;
use crate::experiment::tables::TextTable;
use crate::figure::Page;
use crate::files::write_text;
use std::path::Path;

/// Parts in order: word, heading, explanation.
const PARTS: [[&str; 3]; 2] = [
    [
        "walls",
        "Simulated walls",
        "Small walls with stations, photos, registration errors and noise of their own, measured by the whole program; truth is \
         the simulator's.",
    ],
    [
        "own",
        "The survey's own scans",
        "One epoch is divided at random into two halves, so that nothing moved between them; then motions are put into the \
         second half that are three times as large as what the program says it can detect (lod95).",
    ],
];

pub(super) fn write(certificate: &Certificate, path: &Path) -> Result<()> {
    let mut page = Page::new("Certificate of stonewise");
    page.note(&format!(
        "stonewise {}, program {}, processor {}, {}, seed {}. {}",
        certificate.version,
        certificate.program,
        certificate.processor,
        certificate.made_at,
        certificate.seed,
        match certificate.holds {
            true => "All figures are within what is allowed.",
            false => "Figures are outside what is allowed: see the rows marked NO.",
        }
    ));
    for [part, heading, text] in PARTS {
        let figures: Vec<&Figure> = certificate.figures.iter().filter(|f| f.part == part).collect();
        if figures.is_empty() {
            continue;
        }
        page.heading(heading).note(text);
        let head = ["figure", "value", "allowed", "holds", "note"];
        page.html(&TextTable::new(head, figures.into_iter().map(row).collect()).html(None));
    }
    write_text(path, &page.finish())
}

fn row(figure: &Figure) -> [String; 5] {
    let number = |v: f64| format!("{}", (v * 1e4).round() / 1e4);
    [
        figure.name.clone(),
        figure.value.map_or("\u{2013}".to_owned(), number),
        match (figure.least, figure.most) {
            (Some(least), Some(most)) => format!("{} to {}", number(least), number(most)),
            (Some(least), None) => format!("at least {}", number(least)),
            (None, Some(most)) => format!("at most {}", number(most)),
            (None, None) => "\u{2013}".to_owned(),
        },
        if figure.holds { "yes" } else { "NO" }.to_owned(),
        figure.note.clone(),
    ]
}
