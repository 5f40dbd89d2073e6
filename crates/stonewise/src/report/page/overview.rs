//! The summary and the tables of stones.

use super::html::{details, section, table};
use super::maps::motion_map;
use crate::figure::{count, escape, mm, mm_or_dash, number, percent};
use crate::report::summary::{FALSE_ALARMS, Summary};
use crate::results::records::{Datum, DatumState};
use crate::results::{ResultSet, RowMotion, Sorted, Status, StoneRow};
use nalgebra::Point2;
use std::fmt::Write;

/// Rows of a table of single stones at most; the full list is in stones.csv.
const MAX_ROWS: usize = 25;

/// What moved, how many, where, how sure.
pub(super) fn summary(results: &ResultSet, facts: &Summary) -> String {
    let datum = results.datum();
    let mut out = tiles(facts, datum);
    out.push_str("<div class=\"statement\"><ul class=\"findings\">");
    for sentence in sentences(results, facts, datum) {
        let _ = write!(out, "<li>{sentence}</li>");
    }
    out.push_str("</ul>");
    if !facts.measured.is_empty() {
        out.push_str(&motion_map(results, facts));
    }
    out.push_str("</div>");
    section("summary", "Summary", &out)
}

fn tiles(facts: &Summary, datum: Option<&Datum>) -> String {
    let tile =
        |value: String, what: &str| format!("<div class=\"tile\"><b>{value}</b><span>{what}</span></div>");
    let share = |n: usize| format!("{} <small>{}</small>", count(n), percent(n, facts.stones));
    let of_measured = |n: usize| format!("{} <small>{}</small>", count(n), percent(n, facts.measured.len()));
    let largest = facts.significant.first().map(|(_, m)| m.displacement.norm());
    format!(
        "<div class=\"tiles\">{}{}{}{}{}</div>",
        tile(
            share(facts.measured.len()),
            &format!("of {} stones measured", count(facts.stones))
        ),
        tile(
            of_measured(facts.significant.len()),
            "of these moved significantly"
        ),
        tile(count(facts.loose.len()), "loose: move unlike their neighbours"),
        tile(
            format!("{} <small>mm</small>", mm_or_dash(facts.limits.median())),
            if is_known(datum) {
                "typical detection limit (95 %, median), registration error included"
            } else {
                "typical detection limit (95 %, median) against the common motion of the wall"
            }
        ),
        tile(
            format!("{} <small>mm</small>", mm_or_dash(largest)),
            "largest significant motion"
        ),
    )
}

fn sentences(results: &ResultSet, facts: &Summary, datum: Option<&Datum>) -> Vec<String> {
    if facts.measured.is_empty() {
        let lost = facts
            .by_status
            .iter()
            .map(|(s, stones)| format!("{}: {}", escape(s.meaning()), count(stones.len())));
        let reasons = lost.collect::<Vec<_>>().join("; ");
        return vec![format!("<b>No stone was measured.</b> {reasons}")];
    }
    let mut out = vec![significance(facts)];
    // What all numbers refer to comes first where it is not the ground.
    out.insert(usize::from(is_known(datum)), registration(datum));
    let [along, up, outward] = facts.components.each_ref().map(|c| mm_or_dash(c.median()));
    out.push(format!(
        "Median of all measured stones: <b>{along}</b> mm along the wall, <b>{up}</b> mm up, <b>{outward}</b> mm out of \
         the wall."
    ));
    if facts.motion_is_proven() {
        out.extend(places(facts));
    }
    if let Some((stone, motion)) = facts.significant.first() {
        let place = results.facade.place(&stone.centroid);
        out.push(format!(
            "The largest significant motion is {} mm (detection limit {} mm), stone {} at {} m along, {} m up.",
            mm(motion.displacement.norm()),
            mm(motion.detection_limit_m),
            stone.stone_id,
            number(place.x, 2),
            number(place.y, 2)
        ));
    }
    if results
        .registration
        .as_ref()
        .is_some_and(|r| !r.estimator.converged())
    {
        out.push(
            "<b>The joint adjustment reached its limit of iterations before it settled</b>; see the audit."
                .into(),
        );
    }
    out.push(match facts.loose.len() {
        0 => "No stone is loose: none moves unlike its neighbours beyond what the noise explains.".into(),
        1 => "<b>One stone is loose</b>: it moves unlike its neighbours; it is listed below.".into(),
        n => format!(
            "<b>{} stones are loose</b>: they move unlike their neighbours; they are listed below.",
            count(n)
        ),
    });
    if facts.not_measured() > 0 {
        out.push(not_measured(facts));
    }
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
    if 10 * facts.significant.len() >= 9 * facts.measured.len() {
        out.push("Significant motions are found all over the measured wall.".into());
    } else if let Some(region) = facts.region {
        out.push(format!(
            "Nine tenths of the significant stones lie {}.",
            between(region)
        ));
    }
    if let Some((least, region)) = facts.strongest {
        out.push(format!(
            "The largest tenth of the significant motions, {} mm and more, lies {}.",
            mm(least),
            between(region)
        ));
    }
    out
}

/// Whether the error of the registration of the epochs is known.
fn is_known(datum: Option<&Datum>) -> bool {
    datum.is_some_and(|d| d.state != DatumState::Unknown)
}

/// What is known about the registration of the epochs.
fn registration(datum: Option<&Datum>) -> String {
    match datum {
        Some(datum) if is_known(Some(datum)) => format!("Datum: {}.", escape(&datum.note)),
        _ => "<b>The registration error of the epochs is unknown</b>: limits, intervals and significance hold for motions against the \
            common rigid motion of the measured stones. A motion of the wall as a whole cannot be told from an error of the \
            registration; stable areas outside the wall would show it."
            .into(),
    }
}

/// How many stones have no motion, and why.
fn not_measured(facts: &Summary) -> String {
    let reasons = facts
        .by_status
        .iter()
        .filter(|(status, _)| *status != Status::Ok)
        .map(|(status, stones)| format!("{} because {}", count(stones.len()), escape(status.meaning())));
    format!(
        "{} stones ({}) were not measured, hatched in the maps: {}.",
        count(facts.not_measured()),
        percent(facts.not_measured(), facts.stones),
        reasons.collect::<Vec<_>>().join("; ")
    )
}

fn significance(facts: &Summary) -> String {
    let expected = count((FALSE_ALARMS * facts.measured.len() as f64).round() as usize);
    let n = count(facts.significant.len());
    let sure = format!(
        "half of the stones would show a motion of {} mm, nine tenths one of {} mm",
        mm_or_dash(facts.limits.median()),
        mm_or_dash(facts.limits.quantile(0.9))
    );
    if facts.motion_is_proven() {
        format!(
            "<b>{n} stones moved significantly</b> at the 95 % level; chance alone would flag about {expected} if nothing had \
             moved. How sure: {sure}."
        )
    } else {
        format!(
            "<b>No motion is proven.</b> {n} stones exceed their 95 % limit, and chance alone would flag about {expected}. How \
             sure: {sure}."
        )
    }
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
    if !facts.significant.is_empty() {
        out.push_str("<h3>Largest significant motions</h3>");
        out.push_str(&stone_rows(results, facts, &facts.significant));
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
        let significant = part.iter().filter(|(_, m)| m.significant).count();
        let median = |of: fn(&RowMotion) -> f64| {
            facts.mm(Sorted::new(part.iter().map(|(_, m)| of(m)))
                .median()
                .unwrap_or(f64::NAN))
        };
        vec![
            format!("{} – {}", number(edge(i), 1), number(edge(i + 1), 1)),
            count(part.len()),
            percent(significant, part.len()),
            median(|m| m.face.x),
            median(|m| m.face.y),
            median(|m| m.face.z),
            median(|m| m.detection_limit_m),
        ]
    };
    let head = [
        "along the wall m",
        "measured",
        "significant",
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
