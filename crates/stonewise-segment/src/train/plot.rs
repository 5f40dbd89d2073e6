//! A picture of how a training went.

use super::curve::read_curve;
use super::error::TrainError;
use std::fmt::Write;
use std::path::Path;
use stonewise_io::atomic::write_atomically;

/// Size of a panel, and the room around it for labels, pixels.
const PANEL: [f64; 2] = [720.0, 260.0];
const MARGIN: f64 = 48.0;
/// Losses are shown as means over this share of all steps: single steps scatter widely.
const SMOOTHED_SHARE: f64 = 0.02;
/// Line colours that people with colour-blindness can tell apart (Okabe & Ito 2008).
const COLOURS: [&str; 6] = ["#000000", "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7"];

/// A line of a panel: its name and its points.
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
    let (width, height) = (PANEL[0] + 2.0 * MARGIN + 60.0, 2.0 * (PANEL[1] + 2.0 * MARGIN));

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>"
    );
    panel(&mut svg, MARGIN, "Loss", &losses, [steps, highest.min(8.0)]);
    panel(
        &mut svg,
        3.0 * MARGIN + PANEL[1],
        "Validation",
        &figures,
        [steps, 1.0],
    );
    svg += "</svg>\n";
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

/// A panel whose upper end is at `top`; its axes go from zero to `high`.
fn panel(svg: &mut String, top: f64, title: &str, lines: &[Line], high: [f64; 2]) {
    let x = |value: f64| MARGIN + PANEL[0] * value / high[0];
    let y = |value: f64| top + PANEL[1] * (1.0 - (value / high[1]).min(1.0));
    let [width, height] = PANEL;
    let _ = write!(
        svg,
        "<text x=\"{MARGIN}\" y=\"{}\" font-weight=\"bold\">{title}</text>\
         <rect x=\"{MARGIN}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#888\"/>",
        top - 8.0
    );

    for share in [0.25, 0.5, 0.75, 1.0] {
        let (step, value) = (share * high[0], share * high[1]);
        let _ = write!(
            svg,
            "<path d=\"M{MARGIN} {0:.1}h{width}\" stroke=\"#ddd\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{value:.2}</text>\
             <text x=\"{3:.1}\" y=\"{4}\" text-anchor=\"middle\">{step:.0}</text>",
            y(value),
            MARGIN - 6.0,
            y(value) + 4.0,
            x(step),
            top + height + 16.0
        );
    }

    for (index, (name, points)) in lines.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let path: Vec<String> = points
            .iter()
            .map(|p| format!("{:.1},{:.1}", x(p[0]), y(p[1])))
            .collect();
        let _ = write!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>\
             <text x=\"{}\" y=\"{}\" fill=\"{colour}\">{name}</text>",
            path.join(" "),
            MARGIN + width + 8.0,
            top + 14.0 + 16.0 * index as f64
        );
    }
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
        assert_eq!(svg.matches("<polyline").count(), 12);
        // F1 of 0.3 at step 100 of 199.
        assert!(
            svg.contains(&format!(
                "{:.1},{:.1}",
                48.0 + 720.0 * 100.0 / 199.0,
                404.0 + 260.0 * 0.7
            )),
            "{svg}"
        );
    }
}
