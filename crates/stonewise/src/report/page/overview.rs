//! The summary and the tables of stones.

use super::first_page;
use super::html::{details, section, table};
use crate::figure::{count, escape, mm, mm_or_dash, number, percent};
use crate::report::summary::{FALSE_ALARMS, Summary};
use crate::report_params::Language;
use crate::results::{ResultSet, RowMotion, Sorted, Status, StoneRow};
use crate::texts::fill;
use nalgebra::Point2;
use std::fmt::Write;

/// Rows of a table of single stones at most; the full list is in stones.csv.
const MAX_ROWS: usize = 25;

/// What moved, how many, where, how sure.
pub(super) fn summary(results: &ResultSet, facts: &Summary) -> String {
    let mut out = tiles(facts);
    out.push_str(&first_page::body(results, facts));
    let _ = write!(
        out,
        "<h3 class=\"numbers\">{}</h3>",
        facts.texts().page.in_numbers
    );
    if facts.cover.language != Language::English {
        let _ = write!(
            out,
            "<p class=\"note\">{}</p>",
            facts.texts().page.rest_in_english
        );
    }
    out.push_str("<ul class=\"findings\">");
    for sentence in sentences(results, facts) {
        let _ = write!(out, "<li>{sentence}</li>");
    }
    out.push_str("</ul>");
    section("summary", facts.texts().page.summary, &out)
}

fn tiles(facts: &Summary) -> String {
    let (texts, page) = (facts.texts(), &facts.texts().page);
    let tile =
        |value: String, what: &str| format!("<div class=\"tile\"><b>{value}</b><span>{what}</span></div>");
    let share = |n: usize| format!("{} <small>{}</small>", count(n), percent(n, facts.stones));
    let of_measured = |n: usize| format!("{} <small>{}</small>", count(n), percent(n, facts.measured.len()));
    let mm = |metres: Option<f64>| format!("{} <small>mm</small>", texts.mm(metres.unwrap_or(f64::NAN)));
    let largest = facts.verdict.wall.largest;
    let tiles = [
        tile(
            share(facts.measured.len()),
            &fill(page.tile_measured, &[("m", &count(facts.stones))]),
        ),
        tile(of_measured(facts.moved.len()), page.tile_moved),
        tile(of_measured(facts.above_limit), page.tile_above),
        tile(count(facts.loose.len()), page.tile_loose),
        tile(mm(facts.limits.median()), page.tile_limit),
        match largest {
            Some(largest) => tile(mm(Some(largest.length_mm / 1e3)), page.tile_largest),
            None => tile("\u{2013}".to_owned(), page.tile_no_motion),
        },
    ];
    format!("<div class=\"tiles\">{}</div>", tiles.concat())
}

fn sentences(results: &ResultSet, facts: &Summary) -> Vec<String> {
    let texts = facts.texts();
    if facts.measured.is_empty() {
        let lost = facts
            .by_status
            .iter()
            .map(|(s, stones)| format!("{}: {}", escape(texts.status(*s)), count(stones.len())));
        let reasons = lost.collect::<Vec<_>>().join("; ");
        return vec![format!(
            "<b>{}.</b> {reasons}",
            capital(texts.clauses.nothing_measured)
        )];
    }
    let mut out = vec![first_page::registration(results.datum(), texts), chance(facts)];
    let [along, up, outward] = facts.components.each_ref().map(|c| mm_or_dash(c.median()));
    out.push(format!(
        "Median of all measured stones: <b>{along}</b> mm along the wall, <b>{up}</b> mm up, <b>{outward}</b> mm out of \
         the wall."
    ));
    if !facts.moved.is_empty() {
        out.extend(places(facts));
    }
    out.push(match facts.loose.len() {
        0 => "No stone is loose: none moves unlike its neighbours beyond what the noise explains.".into(),
        1 => "<b>One stone is loose</b>: it moves unlike its neighbours; it is listed below.".into(),
        n => format!(
            "<b>{} stones are loose</b>: they move unlike their neighbours; they are listed below.",
            count(n)
        ),
    });
    out
}

/// Where the motions are, all of them and the largest.
fn places(facts: &Summary) -> Vec<String> {
    let between = |[from, to]: [Point2<f64>; 2]| {
        format!(
            "between {} and {} m along the wall and {} and {} m up the face",
            number(from.x, 1),
            number(to.x, 1),
            number(from.y, 1),
            number(to.y, 1)
        )
    };
    let mut out = Vec::new();
    if 10 * facts.moved.len() >= 9 * facts.measured.len() {
        out.push("Stones that moved are found all over the measured wall.".into());
    } else if let Some(region) = facts.region {
        out.push(format!(
            "Nine tenths of the stones that moved lie {}.",
            between(region)
        ));
    }
    if let Some((least, region)) = facts.strongest {
        out.push(format!(
            "The largest tenth of their motions, {} mm and more, lies {}.",
            mm(least),
            between(region)
        ));
    }
    out
}

/// How many stones are above their limit, how many chance alone would bring there, and how many moved.
fn chance(facts: &Summary) -> String {
    let expected = (FALSE_ALARMS * facts.measured.len() as f64).round() as usize;
    let values = [
        ("above", &*count(facts.above_limit)),
        ("chance", &*count(expected)),
        ("n", &*count(facts.moved.len())),
    ];
    fill(facts.texts().page.chance, &values)
}

/// The text with a capital at its beginning.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters
        .next()
        .map(|c| c.to_uppercase().to_string())
        .unwrap_or_default();
    format!("{first}{}", letters.as_str())
}

/// Outcomes, largest motions, loose stones, stretches.
pub(super) fn tables(results: &ResultSet, facts: &Summary) -> String {
    let mut out = String::from("<h3>Outcomes</h3>");
    let rows: Vec<Vec<String>> = facts
        .by_status
        .iter()
        .map(|(status, stones)| {
            vec![
                format!("<code>{status}</code>"),
                escape(status.meaning()),
                count(stones.len()),
                percent(stones.len(), facts.stones),
            ]
        })
        .collect();
    out.push_str(&table(&["status", "meaning", "stones", "share"], &rows, 2));
    if !facts.moved.is_empty() {
        out.push_str("<h3>Largest motions of stones that moved</h3>");
        out.push_str(&stone_rows(results, facts, &facts.moved));
    }
    if !facts.loose.is_empty() {
        out.push_str("<h3>Loose stones</h3>");
        out.push_str(&stone_rows(results, facts, &facts.loose));
    }
    out.push_str(&stretches(results, facts));
    let lists: String = facts
        .by_status
        .iter()
        .filter(|(s, _)| *s != Status::Ok)
        .map(id_list)
        .collect();
    if !lists.is_empty() {
        out.push_str(&details("Stones that were not measured, by reason", &lists));
    }
    section("tables", "Stones", &out)
}

fn stone_rows(results: &ResultSet, facts: &Summary, stones: &[(&StoneRow, &RowMotion)]) -> String {
    let head = [
        "stone",
        "along m",
        "up m",
        "d along mm",
        "d up mm",
        "d out mm",
        "norm mm",
        "LoD95 mm",
        "against neighbours mm",
        "rotation mrad",
        "loose",
    ];
    let row = |(s, m): &(&StoneRow, &RowMotion)| {
        let place = results.facade.place(&s.centroid);
        vec![
            format!("<a data-stone=\"{0}\">{0}</a>", s.stone_id),
            number(place.x, 2),
            number(place.y, 2),
            facts.mm(m.face.x),
            facts.mm(m.face.y),
            facts.mm(m.face.z),
            facts.mm(m.displacement.norm()),
            facts.mm(m.detection_limit_m),
            facts.mm(m.relative.norm()),
            number(m.rotation.norm() * 1e3, 1),
            if m.loose { "loose" } else { "" }.into(),
        ]
    };
    let rows: Vec<Vec<String>> = stones.iter().take(MAX_ROWS).map(row).collect();
    let mut out = table(&head, &rows, 0);
    if stones.len() > MAX_ROWS {
        let _ = write!(
            out,
            "<p class=\"note\">{MAX_ROWS} of {}; all are in stones.csv.</p>",
            count(stones.len())
        );
    }
    out
}

/// Medians by stretch of the wall.
fn stretches(results: &ResultSet, facts: &Summary) -> String {
    let places = Sorted::new(
        facts
            .measured
            .iter()
            .map(|(s, _)| results.facade.place(&s.centroid).x),
    );
    let (Some(from), Some(to)) = (places.quantile(0.0), places.quantile(1.0)) else {
        return String::new();
    };
    let n = (facts.measured.len() / 30).clamp(1, 10);
    if n < 2 || to - from < 1e-6 {
        return String::new();
    }
    let edge = |i: usize| from + (to - from) * i as f64 / n as f64;
    let row = |i: usize| {
        let inside = |s: &StoneRow| {
            let x = results.facade.place(&s.centroid).x;
            edge(i) <= x && (x < edge(i + 1) || i + 1 == n)
        };
        let part: Vec<_> = facts.measured.iter().filter(|(s, _)| inside(s)).collect();
        let above = part.iter().filter(|(_, m)| m.significant).count();
        let median = |of: fn(&RowMotion) -> f64| {
            facts.mm(Sorted::new(part.iter().map(|(_, m)| of(m)))
                .median()
                .unwrap_or(f64::NAN))
        };
        vec![
            format!("{} – {}", number(edge(i), 1), number(edge(i + 1), 1)),
            count(part.len()),
            percent(above, part.len()),
            median(|m| m.face.x),
            median(|m| m.face.y),
            median(|m| m.face.z),
            median(|m| m.detection_limit_m),
        ]
    };
    let head = [
        "along the wall m",
        "measured",
        "above their limit",
        "d along mm",
        "d up mm",
        "d out mm",
        "LoD95 mm",
    ];
    format!(
        "<h3>By stretch of the wall (medians)</h3>{}",
        table(&head, &(0..n).map(row).collect::<Vec<_>>(), 1)
    )
}

fn id_list((status, stones): &(Status, Vec<&StoneRow>)) -> String {
    let ids: Vec<String> = stones.iter().map(|s| s.stone_id.to_string()).collect();
    format!(
        "<h4><code>{status}</code>: {}</h4><p class=\"ids\">{}</p>",
        escape(status.meaning()),
        ids.join(", ")
    )
}
