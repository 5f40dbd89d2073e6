//! The wall as a drawing for CAD.

use super::layers::exaggeration;
use crate::records::{EpochVerdict, State};
use crate::{ResultSet, Status, StoneRow};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use stonewise_io::dxf::{Drawing, Form, Shape};

/// Height of text as a share of a stone's size.
const TEXT_SHARE: f64 = 0.2;
/// Length of an arrow's barbs as a share of the arrow, and their angle to it, radians.
const BARBS: (f64, f64) = (0.2, 0.4);

/// Adds a later epoch against the first to the drawing of the unrolled wall: outlines, arrows of the motion in the face
/// and the motion out of the wall in millimetres, each on a layer for each state; with the second epoch, the numbers of
/// the stones.
pub(super) fn draw(drawing: &mut Drawing, results: &ResultSet) {
    let number = results.pair + 1;
    let names = results.run.iter().flat_map(|run| &run.epochs);
    let name = names
        .map(|e| e.name.as_str())
        .nth(results.pair)
        .unwrap_or_default();
    let epochs = results.verdict.iter().flat_map(|verdict| &verdict.epochs);
    let states: BTreeMap<u32, Class> = { epochs.filter(|epoch| epoch.epoch == name) }
        .flat_map(classes)
        .collect();
    let factor = exaggeration(results, &results.measured());

    for stone in &results.stones {
        let known = states.get(&stone.stone_id).copied();
        let class = known.unwrap_or(Class::of_status(stone.status));
        let mut add = |kind: &str, form: Form| {
            let layer = format!("E{number}_{kind}_{}", class.word());
            add(drawing, layer, class.colour(), form);
        };
        let middle = results.facade.place(&stone.centroid);
        add(
            "OUTLINE",
            Form::Line {
                vertices: results.unrolled(stone),
                is_closed: true,
            },
        );
        if let Some(motion) = &stone.motion {
            add("ARROW", arrow(middle, motion.face.xy() * factor));
            let text = format!("{:+.1}", 1e3 * motion.face.z);
            add("OUT_MM", line_of_text(stone, middle, -1.0, text));
        }
    }
    if results.pair == 1 {
        for stone in &results.stones {
            let middle = results.facade.place(&stone.centroid);
            let form = line_of_text(stone, middle, 1.0, stone.stone_id.to_string());
            add(drawing, "NUMBERS".to_owned(), 7, form);
        }
    }

    // What the layers mean, below the wall, a line for each epoch.
    let places = { results.stones.iter() }
        .map(|s| results.facade.place(&s.centroid))
        .filter(|p| p.iter().all(|v| v.is_finite()));
    let Some(corner) = places.reduce(|a, b| Point2::new(a.x.min(b.x), a.y.min(b.y))) else {
        return;
    };
    let form = Form::Text {
        middle: corner - Vector2::y() * (1.0 + 0.3 * results.pair as f64),
        height_m: 0.15,
        text: format!("E{number}: {name}; arrows {factor} times exaggerated"),
    };
    add(drawing, "EPOCHS".to_owned(), 7, form);
}

/// The state of a stone, or that it was lost.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    Lost,
    Known(State),
}

impl Class {
    /// That of a stone without a verdict.
    fn of_status(status: Status) -> Self {
        match status {
            Status::UnmatchedLost => Self::Lost,
            _ => Self::Known(State::CannotTell),
        }
    }

    fn word(self) -> String {
        match self {
            Self::Lost => "LOST".to_owned(),
            Self::Known(state) => state.word().to_uppercase().replace(' ', "_"),
        }
    }

    /// In AutoCAD's colour index.
    fn colour(self) -> u8 {
        match self {
            Self::Lost => 6,
            Self::Known(State::Alarm) => 1,
            Self::Known(State::Attention) => 30,
            Self::Known(State::Fine) => 3,
            Self::Known(State::CannotTell) => 8,
        }
    }
}

fn classes(epoch: &EpochVerdict) -> impl Iterator<Item = (u32, Class)> {
    epoch.stones.iter().map(|stone| {
        let class = match stone.lost {
            true => Class::Lost,
            false => Class::Known(stone.state),
        };
        (stone.stone_id, class)
    })
}

fn add(drawing: &mut Drawing, layer: String, colour: u8, form: Form) {
    drawing.layers.insert(layer.clone(), colour);
    drawing.shapes.push(Shape { layer, form });
}

/// An arrow as one line: to the tip, and back along either barb.
fn arrow(from: Point2<f64>, by: Vector2<f64>) -> Form {
    let tip = from + by;
    let (share, angle) = BARBS;
    let barb = |angle: f64| tip - nalgebra::Rotation2::new(angle) * by * share;
    Form::Line {
        vertices: vec![from, tip, barb(angle), tip, barb(-angle)],
        is_closed: false,
    }
}

/// Text in a stone, above its middle (1) or below (-1).
fn line_of_text(stone: &StoneRow, middle: Point2<f64>, side: f64, text: String) -> Form {
    let height_m = TEXT_SHARE * stone.area_m2.max(1e-4).sqrt();
    Form::Text {
        middle: middle + Vector2::y() * side * height_m,
        height_m,
        text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::{StoneVerdict, VERDICT_VERSION, Verdict};
    use crate::testing::{folder, rows, run_record};
    use stonewise_base::thresholds::Thresholds;

    /// How many shapes lie on each layer.
    fn counts(drawing: &Drawing) -> BTreeMap<&str, usize> {
        let mut counts = BTreeMap::new();
        for shape in &drawing.shapes {
            *counts.entry(shape.layer.as_str()).or_default() += 1;
        }
        counts
    }

    #[test]
    fn stones_lie_on_the_layer_of_their_state() {
        let folder = folder(&rows());
        let mut results = ResultSet::read(folder.path()).unwrap();
        let mut drawing = Drawing::default();
        draw(&mut drawing, &results);
        // Of 24 stones 20 were measured; the third is lost.
        let expected = [
            ("E2_ARROW_CANNOT_TELL", 20),
            ("E2_OUTLINE_CANNOT_TELL", 23),
            ("E2_OUTLINE_LOST", 1),
            ("E2_OUT_MM_CANNOT_TELL", 20),
            ("EPOCHS", 1),
            ("NUMBERS", 24),
        ];
        assert_eq!(counts(&drawing), BTreeMap::from(expected));
        assert!(
            drawing
                .shapes
                .iter()
                .all(|s| drawing.layers.contains_key(&s.layer))
        );

        results.run = Some(run_record("Wall", &["A", "B"]));
        let alarm = StoneVerdict {
            stone_id: results.stones[0].stone_id,
            state: State::Alarm,
            ..StoneVerdict::default()
        };
        results.verdict = Some(Verdict {
            version: VERDICT_VERSION,
            state: State::Alarm,
            sentence: String::new(),
            thresholds: Thresholds::default(),
            epochs: vec![EpochVerdict {
                epoch: "B".to_owned(),
                stones: vec![alarm],
                ..EpochVerdict::default()
            }],
            series: None,
        });
        let mut drawing = Drawing::default();
        draw(&mut drawing, &results);
        let found = counts(&drawing);
        let outlines = ["ALARM", "CANNOT_TELL", "LOST"].map(|state| found[&*format!("E2_OUTLINE_{state}")]);
        assert_eq!(outlines, [1, 22, 1]);
        assert_eq!(drawing.layers["E2_ARROW_ALARM"], 1);
    }

    #[test]
    fn barbs_lie_on_either_side_of_an_arrow() {
        let Form::Line { vertices, is_closed } = arrow(Point2::new(1.0, 2.0), Vector2::new(0.0, 10.0)) else {
            panic!("an arrow is a line");
        };
        let [x, y] = [2.0 * 0.4_f64.sin(), 12.0 - 2.0 * 0.4_f64.cos()];
        let expected = [[1.0, 2.0], [1.0, 12.0], [1.0 + x, y], [1.0, 12.0], [1.0 - x, y]];
        assert!(!is_closed && vertices.len() == 5);
        for (vertex, expected) in vertices.iter().zip(expected) {
            assert!((vertex - Point2::from(expected)).norm() < 1e-12, "{vertex}");
        }
    }
}
