//! Curves of the sensitivity analysis.

use super::{Influence, SensitivityOptions, SensitivityPoint};
use crate::error::Result;
use crate::figure::number;
use crate::figure::{Axis, Item, PALETTE, Page, Plot, table};
use crate::files::write_text;
use std::path::Path;
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str =
    "One row per influence, scanner, method and value. Empty cells: no stone was measured.";

/// Writes `sensitivity.csv` with the metadata of its columns, `index.html` and the plots.
pub(super) fn write(points: &[SensitivityPoint], options: &SensitivityOptions, out: &Path) -> Result<()> {
    write_csv(&out.join("sensitivity.csv"), &rows(points)?, DESCRIPTION, None)?;
    let mut page = Page::new("What the results depend on");
    let [width, height] = options.size_m;
    page.note(&format!(
        "{} simulated wall(s) of {width} x {height} m, moved by 54 mm in the plane between two surveys; no errors of \
         registration or datum; one thing changed at a time. RMSE of the norm of the 3D error of the stones that were measured; \
         the share counts the stones that both surveys show.",
        options.seeds.max(1)
    ));
    for influence in Influence::ALL {
        let of: Vec<&SensitivityPoint> = points.iter().filter(|p| p.influence == influence).collect();
        if of.is_empty() {
            continue;
        }
        page.heading(influence.word());
        for scanner in ["TLS", "UAV"] {
            let own: Vec<&SensitivityPoint> = of.iter().copied().filter(|p| p.scanner == scanner).collect();
            if own.is_empty() {
                continue;
            }
            for (name, plot) in [
                ("error", error_plot(influence, scanner, &own)),
                ("share", share_plot(influence, scanner, &own)),
            ] {
                let svg = plot.svg();
                let file = format!("{}-{}-{name}.svg", influence.word(), scanner.to_lowercase());
                write_text(&out.join(file), &svg)?;
                page.html(&svg);
            }
        }
        page.html(&figures(&of));
    }
    write_text(&out.join("index.html"), &page.finish())
}

fn error_plot(influence: Influence, scanner: &str, points: &[&SensitivityPoint]) -> Plot {
    let values = points.iter().map(|p| 1e3 * p.rmse_m[0]);
    let mut plot = Plot::new(
        &format!("{}, {scanner}: error", influence.word()),
        x_axis(influence, points),
        Axis::decades("RMSE, 3D (mm)", values),
        [540.0, 290.0],
    );
    curves(&mut plot, points, |p| 1e3 * p.rmse_m[0]);
    plot
}

fn share_plot(influence: Influence, scanner: &str, points: &[&SensitivityPoint]) -> Plot {
    let mut plot = Plot::new(
        &format!("{}, {scanner}: stones measured", influence.word()),
        x_axis(influence, points),
        Axis::linear("share of the stones", [0.0, 1.05]),
        [540.0, 290.0],
    );
    curves(&mut plot, points, SensitivityPoint::found_share);
    plot
}

fn x_axis(influence: Influence, points: &[&SensitivityPoint]) -> Axis {
    Axis::around(influence.axis(), points.iter().map(|p| p.x), false)
}

/// One line for each kind and method, the paper's dashed.
fn curves(plot: &mut Plot, points: &[&SensitivityPoint], y: impl Fn(&SensitivityPoint) -> f64) {
    let mut keys: Vec<(&str, &str)> = Vec::new();
    for p in points {
        if !keys.contains(&(p.kind.as_str(), p.method.as_str())) {
            keys.push((&p.kind, &p.method));
        }
    }
    let mut kinds: Vec<&str> = Vec::new();
    for (kind, method) in keys {
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
        let own = points.iter().filter(|p| p.kind == kind && p.method == method);
        let mut line: Vec<[f64; 2]> = own.map(|p| [p.x, y(p)]).collect();
        line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let colour = kinds.iter().position(|k| *k == kind).unwrap_or(0) % PALETTE.len();
        let name = match (kind, method) {
            ("", method) => method.to_owned(),
            (kind, "stonewise") => kind.to_owned(),
            (kind, method) => format!("{kind}, {method}"),
        };
        plot.add(Item::Line {
            points: line,
            colour: PALETTE[colour].to_owned(),
            dashed: method == "paper",
            marks: true,
            name,
        });
    }
}

fn figures(points: &[&SensitivityPoint]) -> String {
    let head = [
        "",
        "scanner",
        "method",
        "value",
        "measured",
        "RMSE 3D mm",
        "in-plane per axis mm",
        "out of plane mm",
        "median mm",
        "beyond 1 cm",
    ];
    let rows: Vec<Vec<String>> = points
        .iter()
        .map(|p| {
            let mut row = vec![
                p.kind.clone(),
                p.scanner.clone(),
                p.method.clone(),
                number(p.x, 2),
            ];
            row.push(format!("{} of {}", p.stones[1], p.stones[0]));
            row.extend(p.rmse_m.iter().chain([&p.median_m]).map(|m| number(1e3 * m, 2)));
            row.push(format!("{} %", number(100.0 * p.outlier_rate, 1)));
            row
        })
        .collect();
    table(&head, &rows, None)
}

fn rows(points: &[SensitivityPoint]) -> Result<Table> {
    let mut rows = Table::new();
    let text = |of: &dyn Fn(&SensitivityPoint) -> String| points.iter().map(of).collect::<Vec<String>>();
    let real = |of: &dyn Fn(&SensitivityPoint) -> f64| {
        points
            .iter()
            .map(|p| Some(of(p)).filter(|v| v.is_finite()))
            .collect::<Vec<Option<f64>>>()
    };
    let count = |i: usize| points.iter().map(|p| p.stones[i] as u32).collect::<Vec<u32>>();
    let influence = text(&|p| p.influence.word().to_owned());
    rows.push("influence", "", "quantity that is varied", influence)?;
    let meaning = "curve of the influence; empty if it has only one curve";
    rows.push("kind", "", meaning, text(&|p| p.kind.clone()))?;
    rows.push("scanner", "", "TLS or UAV", text(&|p| p.scanner.clone()))?;
    rows.push("method", "", "stonewise or paper", text(&|p| p.method.clone()))?;
    let meaning = "value of the influence: mean IoU, length in mm or px, or number of photos";
    rows.push("value", "", meaning, real(&|p| p.x))?;
    rows.push("stones", "", "stones that both surveys show", count(0))?;
    rows.push("measured", "", "stones that were measured", count(1))?;
    rows.push("rmse_3d_m", "m", "RMSE of the 3D error", real(&|p| p.rmse_m[0]))?;
    let meaning = "RMSE per axis in the plane of the face";
    rows.push("rmse_in_plane_per_axis_m", "m", meaning, real(&|p| p.rmse_m[1]))?;
    let meaning = "RMSE out of the plane of the face";
    rows.push("rmse_out_of_plane_m", "m", meaning, real(&|p| p.rmse_m[2]))?;
    rows.push(
        "median_3d_m",
        "m",
        "median of the 3D error",
        real(&|p| p.median_m),
    )?;
    let meaning = "share of the measured stones that are wrong by more than 1 cm, 0 to 1";
    rows.push("outlier_rate", "", meaning, real(&|p| p.outlier_rate))?;
    Ok(rows)
}
