//! The grid as a table, a plot and a page.

use super::grid::Dimension;
use super::outcome::{Tuned, TunedPoint};
use crate::error::Result;
use crate::experiment::tables::{Columns, TextTable};
use crate::figure::{Axis, GREY, Item, PALETTE, Page, Plot};
use crate::files::write_text;
use crate::project::Project;
use std::path::Path;
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str = "One row per combination of parameters, over all motions that were tried. Empty error columns: no stone was measured.";

/// Writes `tune.csv` with the metadata of its columns, `tune.svg` and `index.html`.
pub(super) fn write(
    tuned: &Tuned,
    grid: &[Dimension],
    name: &str,
    cases: &[(String, Project)],
    out: &Path,
) -> Result<()> {
    let table = columns(tuned, grid)?;
    write_csv(&out.join("tune.csv"), &table, DESCRIPTION, None)?;
    let plot = scatter(tuned).svg();
    write_text(&out.join("tune.svg"), &plot)?;
    let cases: Vec<&str> = cases.iter().map(|(name, _)| name.as_str()).collect();
    let mut page = Page::new(&format!("Parameters of {name}"));
    page.note(&format!(
        "{} combinations, each tried on: {}. RMSE is that of the norm of the 3D error, all motions together; stones are those \
         that got a motion.",
        tuned.points.len(),
        cases.join("; ")
    ));
    page.heading("Lines for the project file")
        .note("The lowest RMSE among the combinations that measure at least 95 % of the most stones.");
    page.code(if tuned.lines.is_empty() {
        "no combination measured any stone"
    } else {
        &tuned.lines
    });
    page.heading("All combinations").html(&plot);
    page.html(&TextTable::of(&table).html(tuned.recommended));
    write_text(&out.join("index.html"), &page.finish())
}

fn columns(tuned: &Tuned, grid: &[Dimension]) -> Result<Table> {
    let mut columns = Columns::of(&tuned.points);
    for (i, dimension) in grid.iter().enumerate() {
        let text = |p: &TunedPoint| match &p.values[i] {
            toml::Value::String(word) => word.clone(),
            other => other.to_string(),
        };
        columns.add(&dimension.key, "", "parameter of the project file", text)?;
    }
    columns.add("stones", "", "stones of the first epoch", |p| p.stones)?;
    let meaning = "stones that were matched, mean over the motions";
    columns.add("matched", "", meaning, |p| p.matched)?;
    let meaning = "stones that were measured, mean over the motions";
    columns.add("measured", "", meaning, |p| p.measured)?;
    let meaning = "RMSE of the norm of the 3D error";
    columns.add("rmse_3d_m", "m", meaning, TunedPoint::rmse_m)?;
    let meaning = "RMSE per axis in the plane of the face";
    columns.add("rmse_in_plane_per_axis_m", "m", meaning, |p| {
        let square = p.mean(|d| d.in_plane_per_axis.as_ref(), |e| e.rmse_m.powi(2));
        square.map(f64::sqrt)
    })?;
    let meaning = "RMSE out of the plane of the face";
    columns.add("rmse_out_of_plane_m", "m", meaning, |p| {
        let square = p.mean(|d| d.out_of_plane.as_ref(), |e| e.rmse_m.powi(2));
        square.map(f64::sqrt)
    })?;
    let meaning = "95th percentile of the norm of the 3D error, for the motion for which it is largest";
    columns.add("p95_3d_m", "m", meaning, |p| {
        let all = p.scores.iter().filter_map(|s| s.errors.norm_3d.as_ref());
        p.rmse_m().and(all.map(|e| e.p95_m).reduce(f64::max))
    })?;
    let meaning = "share of the measured stones that are outliers, 0 to 1";
    columns.add("outlier_rate", "", meaning, |p| {
        p.mean(|d| d.norm_3d.as_ref(), |e| e.outlier_rate)
    })?;
    let best = tuned.recommended.map(|i| &tuned.points[i].values);
    let meaning = "1 for the combination that is recommended, else 0";
    columns.add("recommended", "", meaning, |p| u32::from(best == Some(&p.values)))?;
    let meaning = "why the stones could not be measured; else empty";
    columns.add("failure", "", meaning, |p| p.failure.clone())?;
    Ok(columns.table)
}

fn scatter(tuned: &Tuned) -> Plot {
    let place = |p: &TunedPoint| p.rmse_m().map(|rmse_m| [p.measured, 1e3 * rmse_m]);
    let all: Vec<[f64; 2]> = tuned.points.iter().filter_map(place).collect();
    let best = tuned.recommended.and_then(|i| place(&tuned.points[i]));
    let mut plot = Plot::new(
        "RMSE against stones measured",
        Axis::around("stones measured", all.iter().map(|p| p[0]), false),
        Axis::decades("RMSE, 3D (mm)", all.iter().map(|p| p[1])),
        [760.0, 400.0],
    );
    let best = best.into_iter().collect();
    for (name, points, colour, radius_px) in [
        ("combinations", all, GREY, 3.0),
        ("recommended", best, PALETTE[1], 6.0),
    ] {
        plot.add(Item::Dots {
            points,
            colour: colour.into(),
            radius_px,
            name: name.into(),
        });
    }
    plot
}
