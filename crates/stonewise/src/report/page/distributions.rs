//! Histograms, in-plane scatter, stones against M3C2, and the datum check.

use super::html::{figure, section, table};
use crate::figure::{count, escape, mm, mm_or_dash};
use crate::report::draw::{Series, histogram, scatter};
use crate::report::summary::Summary;
use crate::results::Comparison;
use crate::results::records::DatumState;
use crate::results::{ResultSet, Sorted};

const NAMES: [&str; 3] = ["along the wall", "up the face", "out of the wall"];

/// Histograms and scatter plots. `truth_mm`: a known common in-plane translation.
pub(super) fn distributions(
    results: &ResultSet,
    facts: &Summary,
    compared: &Comparison,
    truth_mm: Option<[f64; 2]>,
) -> String {
    let mut grid = String::new();
    for (name, component) in NAMES.iter().zip(&facts.components) {
        let values: Vec<f64> = component.values().iter().map(|v| v * 1e3).collect();
        let title = format!("Displacement {name}");
        grid.push_str(&figure(
            &title,
            &histogram(&title, "mm", &values, own_limits_mm(component)),
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
    let note = |n: usize, what: &str| {
        let truth = if truth_mm.is_some() {
            " Cross: the known motion."
        } else {
            ""
        };
        format!("{} {what}.{truth}", count(n))
    };
    let labels = ["along (mm)", "up (mm)"];
    let plot = |key, title: &str, class, points: &Vec<[f64; 2]>| {
        let series = [Series {
            class,
            points: points.clone(),
        }];
        scatter(key, title, labels, &series, limits, truth_mm, false)
    };
    grid.push_str(&figure(
        "In-plane motion of the stones",
        &plot("in-plane", "stones", "a", &stones),
        &note(stones.len(), "stones"),
    ));
    if !vectors.is_empty() {
        let text = note(vectors.len(), "core points; vector = distance times normal");
        grid.push_str(&figure(
            "In-plane part of M3C2",
            &plot("", "M3C2", "b", &vectors),
            &text,
        ));
    }
    if !out_of_plane.is_empty() {
        let pairs: Vec<[f64; 2]> = out_of_plane.iter().map(|d| d.map(|v| v * 1e3)).collect();
        let limits = shared_limits(&[&pairs]);
        let difference = Sorted::new(pairs.iter().map(|p| p[0] - p[1]));
        let text = format!(
            "{} stones; median difference {} mm, NMAD {} mm.",
            count(pairs.len()),
            mm_or_dash(difference.median().map(|v| v / 1e3)),
            mm_or_dash(difference.nmad().map(|v| v / 1e3))
        );
        let series = [Series {
            class: "a",
            points: pairs,
        }];
        let picture = scatter(
            "out-of-plane",
            "out of plane",
            ["stone, out (mm)", "M3C2 (mm)"],
            &series,
            limits,
            None,
            true,
        );
        grid.push_str(&figure("Out of plane: stones against M3C2", &picture, &text));
    }
    section(
        "distributions",
        "Distributions",
        &format!("<div class=\"charts\">{grid}</div>"),
    )
}

/// Limits of a histogram: 98 % of the values and a margin, millimetres; values beyond are counted in the end bars.
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

/// What all stones have in common, and what stands still.
pub(super) fn datum(results: &ResultSet, facts: &Summary) -> String {
    let still: Vec<_> = facts.measured.iter().filter(|(_, m)| !m.significant).collect();
    let rows: Vec<Vec<String>> = (0..3)
        .map(|k| {
            let all = &facts.components[k];
            let rest = Sorted::new(still.iter().map(|(_, m)| m.face[k]));
            let cell = |v: Option<f64>| facts.mm(v.unwrap_or(f64::NAN));
            vec![
                NAMES[k].into(),
                cell(all.median()),
                cell(all.nmad()),
                cell(rest.median()),
                cell(rest.nmad()),
            ]
        })
        .collect();
    let head = [
        "direction",
        "all: median mm",
        "all: NMAD mm",
        "below their limit: median mm",
        "below their limit: NMAD mm",
    ];
    let body = format!(
        "<p>Displacements refer to the registration of the epochs. A motion that all stones share can be a motion of the wall or an \
         error of that registration; only stable points outside the wall can tell. Stones below their own limit should \
         scatter around zero.</p><p>{}</p>{}<p class=\"note\">NMAD: 1.4826 times the median distance from the median, the standard \
         deviation of normally distributed values. {} stones in all, {} below their limit.</p>",
        registration(results),
        table(&head, &rows, 1),
        count(facts.measured.len()),
        count(still.len())
    );
    section("datum", "Datum check", &body)
}

/// What is known about the registration, in words.
fn registration(results: &ResultSet) -> String {
    let estimated = results.datum().filter(|d| d.is_estimated());
    let observers = results.registration.as_ref().and_then(|r| r.observers.as_ref());
    if let (Some(datum), Some(observers)) = (estimated, observers) {
        let axes = ["x", "y", "z"].into_iter().enumerate();
        let part = |(k, axis): (usize, &str)| {
            let sd = datum.covariance_6x6.map_or(0.0, |c| c[k][k].max(0.0).sqrt());
            format!("{axis} {} \u{b1} {} mm", mm(observers.error[k]), mm(sd))
        };
        return format!(
            "Datum: {}. Error of the later epoch in the middle of the wall: {} (one standard deviation, world axes; {} plane cells in stable \
             areas, sources compared on {} stones).",
            escape(&datum.note),
            axes.map(part).collect::<Vec<_>>().join(", "),
            count(observers.stable_cells),
            observers.compared_stones.map(count).join(" and ")
        );
    }
    match results.datum() {
        Some(datum) if datum.state != DatumState::Unknown => format!("Datum: {}.", escape(&datum.note)),
        _ => "<b>The registration error of the epochs is unknown.</b> The project names no stable areas \
            (<code>[[registration.stable]]</code>) that show it and states no error (<code>epoch_error_m</code>): intervals, limits and \
            significance hold for motions against the common rigid motion of the measured stones, not against the ground."
            .into(),
    }
}
