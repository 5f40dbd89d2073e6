//! The grid as a table, a plot and a page.

use super::tuned::PointErrors;
use super::{Tuned, TunedPoint};
use crate::error::Result;
use crate::figure::number;
use crate::figure::{Axis, GREY, Item, PALETTE, Page, Plot, table};
use crate::files::write_text;
use crate::project::Project;
use std::path::Path;
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str = "One row per combination of parameters, over all motions that were tried. Empty error columns: no stone was measured.";

/// Writes `tune.csv` with the metadata of its columns, `tune.svg` and `index.html`.
pub(super) fn write(tuned: &Tuned, project: &Project, cases: &[(String, Project)], out: &Path) -> Result<()> {
    write_csv(&out.join("tune.csv"), &rows(tuned)?, DESCRIPTION, None)?;
    let plot = scatter(tuned).svg();
    write_text(&out.join("tune.svg"), &plot)?;
    let mut page = Page::new(&format!("Parameters of {}", project.name));
    let names: Vec<&str> = cases.iter().map(|(name, _)| name.as_str()).collect();
    page.note(&format!(
        "{} combinations, each tried on: {}. RMSE is that of the norm of the 3D error, all motions together; stones are those \
         that got a motion.",
        tuned.points.len(),
        names.join("; ")
    ));
    page.heading("Lines for the project file")
        .note("The lowest RMSE among the combinations that measure at least 95 % of the most stones.");
    page.code(if tuned.lines.is_empty() {
        "no combination measured any stone"
    } else {
        &tuned.lines
    });
    page.heading("Error against number of stones").html(&plot);
    page.heading("One parameter at a time").note(
        "For every value of a parameter the lowest RMSE of all combinations with it, and the most stones.",
    );
    for i in 0..tuned.grid.len() {
        page.html(&marginal(tuned, i, "lowest RMSE (mm)", &|p| {
            p.errors.map(|e| -1e3 * e.rmse_m)
        }));
        page.html(&marginal(tuned, i, "most stones", &|p| Some(p.measured)));
    }
    page.heading("The combinations that no other beats");
    page.html(&front_table(tuned));
    write_text(&out.join("index.html"), &page.finish())
}

fn rows(tuned: &Tuned) -> Result<Table> {
    let points = &tuned.points;
    let mut rows = Table::new();
    for (i, dimension) in tuned.grid.iter().enumerate() {
        let values: Vec<String> = points.iter().map(|p| text(&p.values[i])).collect();
        rows.push(&dimension.key, "", "parameter of the project file", values)?;
    }
    let real = |of: &dyn Fn(&TunedPoint) -> Option<f64>| points.iter().map(of).collect::<Vec<Option<f64>>>();
    let error = |of: fn(PointErrors) -> f64| {
        points
            .iter()
            .map(|p| p.errors.map(of))
            .collect::<Vec<Option<f64>>>()
    };
    let meaning = "stones of the first epoch";
    rows.push("stones", "", meaning, real(&|p| Some(p.stones)))?;
    let meaning = "stones that were matched, mean over the motions";
    rows.push("matched", "", meaning, real(&|p| Some(p.matched)))?;
    let meaning = "stones that were measured, mean over the motions";
    rows.push("measured", "", meaning, real(&|p| Some(p.measured)))?;
    let meaning = "RMSE of the norm of the 3D error";
    rows.push("rmse_3d_m", "m", meaning, error(|e| e.rmse_m))?;
    let meaning = "RMSE per axis in the plane of the face";
    rows.push("rmse_in_plane_per_axis_m", "m", meaning, error(|e| e.in_plane_m))?;
    let meaning = "RMSE out of the plane of the face";
    rows.push("rmse_out_of_plane_m", "m", meaning, error(|e| e.out_of_plane_m))?;
    let meaning = "95th percentile of the norm of the 3D error, for the motion for which it is largest";
    rows.push("p95_3d_m", "m", meaning, error(|e| e.p95_m))?;
    let meaning = "share of the measured stones that are outliers, 0 to 1";
    rows.push("outlier_rate", "", meaning, error(|e| e.outlier_rate))?;
    let flag = |is: &dyn Fn(usize) -> bool| (0..points.len()).map(|i| u32::from(is(i))).collect::<Vec<u32>>();
    let meaning = "1 on the Pareto front (no other row is better in both error and number of stones), else 0";
    rows.push("front", "", meaning, flag(&|i| tuned.front.contains(&i)))?;
    let meaning = "1 for the combination that is recommended, else 0";
    rows.push(
        "recommended",
        "",
        meaning,
        flag(&|i| tuned.recommended == Some(i)),
    )?;
    let failures: Vec<Option<String>> = points.iter().map(|p| p.failure.clone()).collect();
    rows.push(
        "failure",
        "",
        "why the stones could not be measured; else empty",
        failures,
    )?;
    Ok(rows)
}

fn text(value: &toml::Value) -> String {
    match value {
        toml::Value::String(s) => s.clone(),
        other => other.to_string(),
    }
}

fn scatter(tuned: &Tuned) -> Plot {
    let place = |p: &TunedPoint| p.errors.map(|e| [p.measured, 1e3 * e.rmse_m]);
    let all: Vec<[f64; 2]> = tuned.points.iter().filter_map(place).collect();
    let of = |indices: &[usize]| -> Vec<[f64; 2]> {
        indices.iter().filter_map(|&i| place(&tuned.points[i])).collect()
    };
    let mut plot = Plot::new(
        "RMSE against stones measured",
        Axis::around("stones measured", all.iter().map(|p| p[0]), false),
        Axis::decades("RMSE, 3D (mm)", all.iter().map(|p| p[1])),
        [760.0, 400.0],
    );
    plot.add(Item::Dots {
        points: all,
        colour: GREY.into(),
        radius_px: 3.0,
        name: "combinations".into(),
    });
    plot.add(Item::Line {
        points: of(&tuned.front),
        colour: PALETTE[0].into(),
        dashed: false,
        marks: true,
        name: "front".into(),
    });
    if let Some(i) = tuned.recommended {
        plot.add(Item::Dots {
            points: of(&[i]),
            colour: PALETTE[1].into(),
            radius_px: 6.0,
            name: "recommended".into(),
        });
    }
    plot
}

/// The best of a figure for each value of one dimension; `figure` is larger where better, and may be a
/// negated error.
fn marginal(
    tuned: &Tuned,
    dimension: usize,
    label: &str,
    figure: &dyn Fn(&TunedPoint) -> Option<f64>,
) -> String {
    let Some(d) = tuned.grid.get(dimension) else {
        return String::new();
    };
    let best = |value: &toml::Value| {
        let with = tuned.points.iter().filter(|p| &p.values[dimension] == value);
        with.filter_map(figure).reduce(f64::max).map(f64::abs)
    };
    // Words have no place on an axis: they get their number in the list.
    let at = |i: usize, value: &toml::Value| {
        let number = value.as_float().or(value.as_integer().map(|n| n as f64));
        number.unwrap_or(i as f64)
    };
    let points: Vec<[f64; 2]> = d
        .values
        .iter()
        .enumerate()
        .filter_map(|(i, v)| Some([at(i, v), best(v)?]))
        .collect();
    let words: Vec<String> = d.values.iter().filter(|v| v.is_str()).map(text).collect();
    let title = if words.is_empty() {
        d.key.clone()
    } else {
        format!("{} (0..: {})", d.key, words.join(", "))
    };
    let mut plot = Plot::new(
        &title,
        Axis::around(&d.key, points.iter().map(|p| p[0]), false),
        Axis::around(label, points.iter().map(|p| p[1]), true),
        [400.0, 230.0],
    );
    plot.add(Item::Line {
        points,
        colour: PALETTE[0].into(),
        dashed: false,
        marks: true,
        name: String::new(),
    });
    plot.svg()
}

fn front_table(tuned: &Tuned) -> String {
    let mut head: Vec<&str> = tuned.grid.iter().map(|d| d.key.as_str()).collect();
    head.extend([
        "stones measured",
        "RMSE 3D mm",
        "in-plane per axis mm",
        "out of plane mm",
        "95 % mm",
        "beyond 1 cm",
    ]);
    let rows: Vec<Vec<String>> = tuned
        .front
        .iter()
        .map(|&i| {
            let point = &tuned.points[i];
            let mut row: Vec<String> = point.values.iter().map(text).collect();
            row.push(number(point.measured, 0));
            if let Some(e) = point.errors {
                row.extend([e.rmse_m, e.in_plane_m, e.out_of_plane_m, e.p95_m].map(|m| number(1e3 * m, 2)));
                row.push(format!("{} %", number(100.0 * e.outlier_rate, 1)));
            }
            row
        })
        .collect();
    let best = tuned.front.iter().position(|&i| tuned.recommended == Some(i));
    table(&head, &rows, best)
}
