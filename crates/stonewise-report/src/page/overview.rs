//! The summary and the tables of stones.

use super::first_page;
use super::html::{details, section, table, with_units};
use crate::summary::{FALSE_ALARMS, Summary};
use crate::texts::{Texts, fill};
use nalgebra::Point2;
use std::fmt::Write;
use stonewise_figure::{count, escape};
use stonewise_results::{ResultSet, RowMotion, Sorted, Status, StoneRow};

/// Rows of a table of single stones at most; the full list is in stones.csv.
const MAX_ROWS: usize = 25;

/// What moved, how many, where, how sure.
pub(super) fn summary(results: &ResultSet, facts: &Summary) -> String {
    let mut out = tiles(facts);
    out.push_str(&first_page::body(results, facts));
    out.push_str(&first_page::remarks(results, facts));
    let _ = write!(out, "<h3 class=\"numbers\">{}</h3>", facts.texts.page.in_numbers);
    out.push_str("<ul class=\"findings\">");
    for sentence in sentences(results, facts) {
        let _ = write!(out, "<li>{}</li>", with_units(&sentence));
    }
    out.push_str("</ul>");
    section("summary", facts.texts.page.summary, &out)
}

fn tiles(facts: &Summary) -> String {
    let (texts, page) = (facts.texts, &facts.texts.page);
    let tile =
        |value: String, what: &str| format!("<div class=\"tile\"><b>{value}</b><span>{what}</span></div>");
    let share = |n: usize| format!("{} <small>{}</small>", count(n), texts.percent(n, facts.stones));
    let of_measured = |n: usize| {
        let share = texts.percent(n, facts.measured.len());
        format!("{} <small>{share}</small>", count(n))
    };
    let measured = tile(
        share(facts.measured.len()),
        &fill(page.tile_measured, &[("m", &count(facts.stones))]),
    );

    if !facts.verdict.is_sound() {
        let unknown = tile("\u{2013}".to_owned(), page.tile_cannot_tell);
        return format!(
            "<p class=\"hedge\">{}</p><div class=\"tiles\">{measured}{unknown}</div>",
            page.as_computed
        );
    }

    let mm = |metres: Option<f64>| format!("{} <small>mm</small>", texts.mm(metres.unwrap_or(f64::NAN)));
    let largest = facts.verdict.wall.largest;
    let [what_moved, what_is_largest] = match facts.verdict.has_datum() {
        true => [page.tile_moved, page.tile_largest],
        false => [page.tile_moved_common, page.tile_largest_common],
    };
    let tiles = [
        measured,
        tile(of_measured(facts.moved.len()), what_moved),
        tile(count(facts.loose.len()), page.tile_loose),
        match largest {
            Some(largest) => tile(mm(Some(largest.length_mm / 1e3)), what_is_largest),
            None => tile("\u{2013}".to_owned(), page.tile_no_motion),
        },
    ];

    format!("<div class=\"tiles\">{}</div>", tiles.concat())
}

fn sentences(results: &ResultSet, facts: &Summary) -> Vec<String> {
    let texts = facts.texts;
    if facts.measured.is_empty() {
        let [colon, between] = ["language.colon", "language.clause"].map(|key| texts.language.text(key));
        let lost = facts
            .by_status
            .iter()
            .map(|(s, stones)| format!("{}{colon}{}", escape(texts.status(*s)), count(stones.len())));
        let reasons = lost.collect::<Vec<_>>().join(between);
        return vec![format!(
            "<b>{}.</b> {reasons}",
            capital(texts.clauses.nothing_measured)
        )];
    }

    let mut out = vec![first_page::registration(results.datum(), facts)];
    if facts.verdict.is_sound() {
        out.push(chance(facts));
    }
    let [along, up, outward] = facts.components.each_ref().map(|c| texts.mm_or_dash(c.median()));
    let values = [("along", &*along), ("up", &*up), ("out", &*outward)];
    out.push(fill(texts.stones.median, &values));
    if !facts.verdict.is_sound() {
        return out;
    }
    if !facts.moved.is_empty() {
        out.extend(places(facts));
    }
    out.push(match facts.loose.len() {
        0 => texts.stones.none_loose.to_owned(),
        1 => texts.stones.one_loose.to_owned(),
        n => fill(texts.stones.some_loose, &[("n", &*count(n))]),
    });

    out
}

/// Where the motions are, all of them and the largest.
fn places(facts: &Summary) -> Vec<String> {
    let texts = facts.texts;
    let between = |[from, to]: [Point2<f64>; 2]| {
        let [a0, a1, u0, u1] = [from.x, to.x, from.y, to.y].map(|v| texts.number(v, 1));
        let values = [("a0", &*a0), ("a1", &*a1), ("u0", &*u0), ("u1", &*u1)];
        fill(texts.stones.between, &values)
    };
    let mut out = Vec::new();
    if 10 * facts.moved.len() >= 9 * facts.measured.len() {
        out.push(texts.stones.all_over.to_owned());
    } else if let Some(region) = facts.region {
        out.push(fill(texts.stones.nine_tenths, &[("where", &*between(region))]));
    }
    if let Some((least, region)) = facts.strongest {
        let values = [("least", &*texts.mm(least)), ("where", &*between(region))];
        out.push(fill(texts.stones.largest_tenth, &values));
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
    fill(facts.texts.page.chance, &values)
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
    let texts = facts.texts;
    let names = &texts.stones;
    let mut out = format!("<h3>{}</h3>", names.outcomes);
    let rows: Vec<Vec<String>> = facts
        .by_status
        .iter()
        .map(|(status, stones)| {
            vec![
                format!("<code>{}</code>", status.word().replace('_', "_<wbr>")),
                escape(texts.status(*status)),
                count(stones.len()),
                texts.percent(stones.len(), facts.stones),
            ]
        })
        .collect();

    out.push_str(&table(
        &[names.status, names.meaning, names.stones, names.share],
        &rows,
        2,
    ));

    // Which stones moved or are loose, a run in doubt cannot tell.
    if !facts.moved.is_empty() && facts.verdict.is_sound() {
        let _ = write!(out, "<h3>{}</h3>", names.largest);
        out.push_str(&stone_rows(results, facts, &facts.moved));
    }

    if !facts.loose.is_empty() && facts.verdict.is_sound() {
        let _ = write!(out, "<h3>{}</h3>", names.loose_stones);
        out.push_str(&stone_rows(results, facts, &facts.loose));
    }

    out.push_str(&stretches(results, facts));
    let lists: String = facts
        .by_status
        .iter()
        .filter(|(s, _)| *s != Status::Ok)
        .map(|list| id_list(list, texts))
        .collect();
    if !lists.is_empty() {
        out.push_str(&details(names.by_reason, &lists));
    }
    section("tables", texts.sections.tables, &out)
}

fn stone_rows(results: &ResultSet, facts: &Summary, stones: &[(&StoneRow, &RowMotion)]) -> String {
    let texts = facts.texts;
    let names = &texts.stones;
    let head = [
        names.stone,
        names.along,
        names.up,
        names.d_along,
        names.d_up,
        names.d_out,
        names.norm,
        names.limit,
        names.neighbours,
        names.rotation,
        names.loose,
    ];

    let row = |(s, m): &(&StoneRow, &RowMotion)| {
        let place = results.facade.place(&s.centroid);
        vec![
            format!("<a data-stone=\"{0}\">{0}</a>", s.stone_id),
            texts.number(place.x, 2),
            texts.number(place.y, 2),
            texts.mm(m.face.x),
            texts.mm(m.face.y),
            texts.mm(m.face.z),
            texts.mm(m.displacement.norm()),
            texts.mm(m.detection_limit_m),
            texts.mm(m.relative.norm()),
            texts.number(m.rotation.norm() * 1e3, 1),
            if m.loose { names.loose } else { "" }.into(),
        ]
    };

    let rows: Vec<Vec<String>> = stones.iter().take(MAX_ROWS).map(row).collect();
    let mut out = table(&head, &rows, 0);
    if stones.len() > MAX_ROWS {
        let values = [("shown", &*MAX_ROWS.to_string()), ("n", &*count(stones.len()))];
        let _ = write!(out, "<p class=\"note\">{}</p>", fill(names.rest, &values));
    }

    out
}

/// Medians by stretch of the wall; without limits where a run is in doubt.
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
    let texts = facts.texts;

    let edge = |i: usize| from + (to - from) * i as f64 / n as f64;
    let row = |i: usize| {
        let inside = |s: &StoneRow| {
            let x = results.facade.place(&s.centroid).x;
            edge(i) <= x && (x < edge(i + 1) || i + 1 == n)
        };
        let part: Vec<_> = facts.measured.iter().filter(|(s, _)| inside(s)).collect();
        let above = part.iter().filter(|(_, m)| m.significant).count();
        let median = |of: fn(&RowMotion) -> f64| {
            texts.mm(Sorted::new(part.iter().map(|(_, m)| of(m)))
                .median()
                .unwrap_or(f64::NAN))
        };
        let mut row = vec![
            format!("{} – {}", texts.number(edge(i), 1), texts.number(edge(i + 1), 1)),
            count(part.len()),
            median(|m| m.face.x),
            median(|m| m.face.y),
            median(|m| m.face.z),
        ];
        if facts.verdict.is_sound() {
            row.push(median(|m| m.detection_limit_m));
            row.push(texts.percent(above, part.len()));
        }
        row
    };

    let names = &texts.stones;
    let head = [
        names.stretch,
        names.measured,
        names.d_along,
        names.d_up,
        names.d_out,
        names.limit,
        names.above,
    ];
    let columns = if facts.verdict.is_sound() { 7 } else { 5 };

    format!(
        "<h3>{}</h3>{}",
        names.stretches,
        table(&head[..columns], &(0..n).map(row).collect::<Vec<_>>(), 1)
    )
}

fn id_list((status, stones): &(Status, Vec<&StoneRow>), texts: &Texts) -> String {
    let ids: Vec<String> = stones.iter().map(|s| s.stone_id.to_string()).collect();
    format!(
        "<h4><code>{status}</code>: {}</h4><p class=\"ids\">{}</p>",
        escape(texts.status(*status)),
        ids.join(", ")
    )
}
