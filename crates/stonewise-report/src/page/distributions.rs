//! Histograms, in-plane scatter, stones against M3C2, and the datum check.

use super::first_page::said;
use super::html::{figure, section, table};
use crate::draw::{Guide, Series, histogram, scatter};
use crate::summary::Summary;
use crate::texts::{ChartTexts, Texts, fill};
use std::iter;
use stonewise_figure::count;
use stonewise_results::Comparison;
use stonewise_results::records::DatumState;
use stonewise_results::{ResultSet, Sorted};

/// The three directions in words.
fn directions(names: &ChartTexts) -> [&'static str; 3] {
    [names.along, names.up, names.out]
}

/// Histograms and scatter plots. `truth_mm`: a known common in-plane translation.
pub(super) fn distributions(
    results: &ResultSet,
    facts: &Summary,
    compared: &Comparison,
    truth_mm: Option<[f64; 2]>,
) -> String {
    let texts = facts.texts;
    let names = &texts.charts;
    let mut grid = String::new();

    for (name, component) in directions(names).iter().zip(&facts.components) {
        let values: Vec<f64> = component.values().iter().map(|v| v * 1e3).collect();
        let title = fill(names.displacement, &[("direction", *name)]);
        grid.push_str(&figure(
            &title,
            &histogram(
                &title,
                texts.axis("mm", own_limits_mm(component)),
                texts.stones.stones,
                &values,
            ),
            "",
        ));
    }

    let out_of_plane = compared.out_of_plane(results);
    let stones: Vec<[f64; 2]> = facts
        .measured
        .iter()
        .map(|(_, m)| [m.face.x * 1e3, m.face.y * 1e3])
        .collect();
    let vectors: Vec<[f64; 2]> = compared.in_plane.iter().map(|d| d.map(|v| v * 1e3)).collect();
    let limits = shared_limits(&[&stones, &vectors, truth_mm.as_slice()]);
    let note = |n: usize, text: &str| {
        let truth = if truth_mm.is_some() { names.cross } else { "" };
        format!("{}{truth}", fill(text, &[("n", &*count(n))]))
    };
    let axes = |[x, y]: [&str; 2], [across, up]: [[f64; 2]; 2]| [texts.axis(x, across), texts.axis(y, up)];
    let labels = [names.axis_along, names.axis_up];

    let plot = |key, title: &str, class, points: &Vec<[f64; 2]>| {
        let series = [Series {
            class,
            points: points.clone(),
        }];
        let guide = truth_mm.map_or(Guide::None, Guide::Cross);
        scatter(key, title, axes(labels, limits), &series, guide)
    };

    grid.push_str(&figure(
        names.stones_title,
        &plot("in-plane", names.stones_title, "a", &stones),
        &note(stones.len(), names.stones),
    ));

    if !vectors.is_empty() {
        let text = note(vectors.len(), names.m3c2);
        grid.push_str(&figure(
            names.m3c2_title,
            &plot("", names.m3c2_title, "b", &vectors),
            &text,
        ));
    }

    if !out_of_plane.is_empty() {
        let pairs: Vec<[f64; 2]> = out_of_plane.iter().map(|d| d.map(|v| v * 1e3)).collect();
        let limits = shared_limits(&[&pairs]);
        let difference = Sorted::new(pairs.iter().map(|p| p[0] - p[1]));
        let values = [
            ("n", &*count(pairs.len())),
            ("median", &*texts.mm_or_dash(difference.median().map(|v| v / 1e3))),
            ("nmad", &*texts.mm_or_dash(difference.nmad().map(|v| v / 1e3))),
        ];
        let text = fill(names.out_note, &values);
        let series = [Series {
            class: "a",
            points: pairs,
        }];
        let picture = scatter(
            "out-of-plane",
            names.out_title,
            axes([names.axis_out, "M3C2 (mm)"], limits),
            &series,
            Guide::Diagonal,
        );
        grid.push_str(&figure(names.out_title, &picture, &text));
    }

    section(
        "distributions",
        texts.sections.distributions,
        &format!("<div class=\"charts\">{grid}</div>"),
    )
}

/// Limits of a histogram: 98 % of the values and a margin, millimetres; values beyond are counted in the end
/// bars.
fn own_limits_mm(values: &Sorted) -> [f64; 2] {
    let (low, high) = (
        values.quantile(0.01).unwrap_or(0.0) * 1e3,
        values.quantile(0.99).unwrap_or(0.0) * 1e3,
    );
    let margin = (0.15 * (high - low)).max(0.02);
    [low - margin, high + margin]
}

/// Limits that hold 98 % of every series and zero, with equal lengths on both axes.
fn shared_limits(series: &[&[[f64; 2]]]) -> [[f64; 2]; 2] {
    let range = |k: usize| {
        series.iter().fold([0.0f64, 0.0f64], |[low, high], points| {
            let values = Sorted::new(points.iter().map(|p| p[k]));
            [
                low.min(values.quantile(0.01).unwrap_or(0.0)),
                high.max(values.quantile(0.99).unwrap_or(0.0)),
            ]
        })
    };
    let ranges = [range(0), range(1)];
    let half = ranges.iter().map(|r| (r[1] - r[0]) / 2.0).fold(0.05, f64::max) * 1.2;
    ranges.map(|r| [(r[0] + r[1]) / 2.0 - half, (r[0] + r[1]) / 2.0 + half])
}

/// What all stones have in common, and what stands still; the latter is unknown where a run is in doubt.
pub(super) fn datum(results: &ResultSet, facts: &Summary) -> String {
    let texts = facts.texts;
    let names = &texts.charts;
    let is_sound = facts.verdict.is_sound();
    let columns = if is_sound { 4 } else { 2 };
    let still: Vec<_> = facts.measured.iter().filter(|(_, m)| !m.significant).collect();
    let rows: Vec<Vec<String>> = (0..3)
        .map(|k| {
            let all = &facts.components[k];
            let rest = Sorted::new(still.iter().map(|(_, m)| m.face[k]));
            let row = [all.median(), all.nmad(), rest.median(), rest.nmad()];
            let cells = row.into_iter().take(columns).map(|v| texts.mm_or_dash(v));
            iter::once(directions(names)[k].to_owned()).chain(cells).collect()
        })
        .collect();

    let head = [
        names.direction,
        names.all_median,
        names.all_nmad,
        names.below_median,
        names.below_nmad,
    ];
    let values = [
        ("n", &*count(facts.measured.len())),
        ("below", &*count(still.len())),
    ];
    let [below, nmad_below] = match is_sound {
        true => [names.datum_below.to_owned(), fill(names.nmad_below, &values)],
        false => [String::new(), String::new()],
    };

    let body = format!(
        "<p>{}{below}</p><p>{}</p>{}<p class=\"note\">{}{nmad_below}</p>",
        names.datum,
        registration(results, texts),
        table(&head[..=columns], &rows, 1),
        fill(names.nmad, &values)
    );
    section("datum", texts.sections.datum_title, &body)
}

/// What is known about the registration, in words.
fn registration(results: &ResultSet, texts: &Texts) -> String {
    let names = &texts.charts;
    let estimated = results.datum().filter(|d| d.is_estimated());
    let observers = results.registration.as_ref().and_then(|r| r.observers.as_ref());
    if let (Some(datum), Some(observers)) = (estimated, observers) {
        let axes = ["x", "y", "z"].into_iter().enumerate();
        let part = |(k, axis): (usize, &str)| {
            let sd = datum.covariance_6x6.map_or(0.0, |c| c[k][k].max(0.0).sqrt());
            format!(
                "{axis} {} \u{b1} {} mm",
                texts.mm(observers.error[k]),
                texts.mm(sd)
            )
        };
        let values = [
            ("note", &*said(&datum.note, &datum.translations, texts)),
            ("parts", &*axes.map(part).collect::<Vec<_>>().join(", ")),
            ("cells", &*count(observers.stable_cells)),
            ("compared", &*observers.compared_stones.map(count).join(names.and)),
        ];
        return fill(names.estimated, &values);
    }
    match results.datum() {
        Some(datum) if datum.state != DatumState::Unknown => fill(
            names.known,
            &[("note", &*said(&datum.note, &datum.translations, texts))],
        ),
        _ => names.unknown.to_owned(),
    }
}
