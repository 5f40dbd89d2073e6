//! A picture of how a training went.

use super::curve::read_curve;
use super::error::TrainError;
use std::path::Path;
use stonewise_figure::{Axis, Item, PALETTE, Plot};
use stonewise_io::atomic::write_atomically;

/// Size of a plot, pixels.
const SIZE: [f64; 2] = [880.0, 320.0];
/// Losses above this are not shown: those of the first steps would flatten the rest.
const LOSS_SHOWN: f64 = 8.0;
/// Losses are shown as means over this share of all steps: single steps scatter widely.
const SMOOTHED_SHARE: f64 = 0.02;

/// A line of a plot: its name and its points.
type Line = (&'static str, Vec<[f64; 2]>);

/// Draws the losses and the figures on the validation images over the steps.
///
/// # Errors
/// The curves cannot be read, or the picture cannot be written.
pub fn draw_curves(loss: &Path, validation: &Path, picture: &Path) -> Result<(), TrainError> {
    let losses = columns(
        &read_curve(loss)?,
        &[
            ("total", 10),
            ("objectness", 5),
            ("proposals", 6),
            ("class", 7),
            ("box", 8),
            ("mask", 9),
        ],
    );
    let losses: Vec<Line> = losses
        .into_iter()
        .map(|(name, points)| (name, smooth(&points)))
        .collect();

    let figures = columns(
        &read_curve(validation)?,
        &[
            ("precision", 2),
            ("recall", 3),
            ("F1", 4),
            ("mean IoU", 5),
            ("AP50", 6),
            ("AP", 7),
        ],
    );
    let steps = losses.iter().flat_map(|l| &l.1).map(|p| p[0]).fold(1.0, f64::max);
    let highest = losses.iter().flat_map(|l| &l.1).map(|p| p[1]).fold(0.1, f64::max);
    let [width, height] = SIZE;
    let panels = [
        plot("Loss", &losses, [steps, highest.min(LOSS_SHOWN)]),
        plot("Validation", &figures, [steps, 1.0]),
    ];
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{}\">{}<g transform=\"translate(0 {height})\">{}</g></svg>\n",
        2.0 * height,
        panels[0].svg(),
        panels[1].svg()
    );
    write_atomically(picture, |partial| std::fs::write(partial, svg))
        .map_err(TrainError::io("drawing the curves", picture))
}

fn columns(rows: &[Vec<f64>], wanted: &[(&'static str, usize)]) -> Vec<Line> {
    let points = |column: usize| {
        let point = |row: &Vec<f64>| Some([*row.first()?, *row.get(column)?]);
        rows.iter().filter_map(point).collect()
    };
    wanted
        .iter()
        .map(|&(name, column)| (name, points(column)))
        .collect()
}

/// Means over consecutive points.
fn smooth(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let size = ((points.len() as f64 * SMOOTHED_SHARE) as usize).max(1);
    let mean = |part: &[[f64; 2]], axis: usize| part.iter().map(|p| p[axis]).sum::<f64>() / part.len() as f64;
    points
        .chunks(size)
        .map(|part| [mean(part, 0), mean(part, 1)])
        .collect()
}

/// A plot whose axes go from zero to `high`.
fn plot(title: &str, lines: &[Line], high: [f64; 2]) -> Plot {
    let (x, y) = (
        Axis::linear("step", [0.0, high[0]]),
        Axis::linear("", [0.0, high[1]]),
    );
    let mut plot = Plot::new(title, x, y, SIZE);
    for ((name, points), colour) in lines.iter().zip(PALETTE) {
        plot.add(Item::Line {
            points: points.clone(),
            colour: colour.to_owned(),
            dashed: false,
            marks: false,
            name: (*name).to_owned(),
        });
    }
    plot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_shows_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let [loss, validation, picture] =
            ["loss.csv", "validation.csv", "curves.svg"].map(|n| folder.path().join(n));
        let rows: String = (1..200)
            .map(|i| format!("{i},1,1,1,0,1,2,3,4,5,{}\n", 15.0 / f64::from(i)))
            .collect();
        std::fs::write(&loss, format!("header\n{rows}")).unwrap();
        std::fs::write(&validation, "header\n100,1,0.5,0.25,0.3,0.8,0.2,0.1\n").unwrap();
        draw_curves(&loss, &validation, &picture).unwrap();
        let svg = std::fs::read_to_string(&picture).unwrap();
        let names = ["total", "objectness", "proposals", "class", "box", "mask"];
        let figures = ["precision", "recall", "F1", "mean IoU", "AP50", "AP"];
        for name in names.iter().chain(&figures) {
            assert!(svg.contains(&format!(">{name}</text>")), "{name}: {svg}");
        }
        // One outer picture and one of each plot.
        assert_eq!(
            (svg.matches("<svg").count(), svg.matches("</svg>").count()),
            (3, 3)
        );
    }
}
