//! Scores a detector on rendered walls whose seeds are kept apart: `kept-walls [FIRST_SEED COUNT [WEIGHTS
//! [CLOUD [MIN_SCORE [dry]]]]]`, CLOUD: none, terrestrial, drone or stereo; dry: the same walls laid dry.
//! Prints a table by size of the stones, light and contrast of the joints, for docs/src/accuracy.md, and on standard
//! error the counts and the sum of IoU of each wall, by which two detectors can be compared wall by wall.
//!
//! Whoever chooses thresholds, tiles or training by these walls makes them development walls: take other
//! seeds then, and say so.

use super::survey_kind;
use crate::Outcome;
use crate::table::Table;
use crate::words::Words;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use stonewise_core::progress::Silent;
use stonewise_core::raster::{LabelImage, RgbImage};
use stonewise_segment::evaluation::pair_masks;
use stonewise_segment::tiling::{TilingOptions, segment_photo};
use stonewise_segment::train::synth::{MasonryStyle, Survey, masonry_photo_of};
use stonewise_segment::{Sample, StoneFinder, Weights};

/// First of the seeds that are kept apart. Training draws 64-bit seeds, the test of the built-in weights uses
/// 9,000 to 9,011, and 20,000 to 20,059 were used to choose the built-in weights and `min_score`.
const FIRST_SEED: u64 = 21_000;
const COUNT: u64 = 60;
/// Edge of a photo, pixels: several stones of the largest class.
const SIDE_PX: u32 = 480;
/// How far from a stone the joint is looked at, pixels.
const JOINT_PX: i64 = 3;

/// Upper ends of the classes and their names.
const ALL: [(f64, &str); 1] = [(f64::INFINITY, "all")];
const SIZES: [(f64, &str); 4] = [
    (20.0, "stones below 20 px"),
    (40.0, "20 to 40 px"),
    (80.0, "40 to 80 px"),
    (f64::INFINITY, "above 80 px"),
];
const LIGHTS: [(f64, &str); 3] = [
    (60.0, "dark stones (below 60 of 255)"),
    (150.0, "60 to 150"),
    (f64::INFINITY, "above 150"),
];
const CONTRASTS: [(f64, &str); 3] = [
    (10.0, "joints that differ by less than 10 of 255"),
    (30.0, "10 to 30"),
    (f64::INFINITY, "more than 30"),
];

pub fn run(words: &Words) -> Outcome {
    let word = |place: usize| words.as_slice().get(place).map(String::as_str);
    let first: u64 = words.number_at(0).unwrap_or(FIRST_SEED);
    let count: u64 = words.number_at(1).unwrap_or(COUNT);
    let weights = word(2).map_or(Weights::BuiltIn, |w| Weights::named(Path::new(w)));
    let mut options = TilingOptions::default();
    options.min_score = words.number_at(4).unwrap_or(options.min_score);
    let detector = StoneFinder::open(&weights, options.min_score as f32)?;
    let kind = survey_kind(word(3).unwrap_or("none"));
    let style = match word(5) {
        None => MasonryStyle::random,
        Some("dry") => MasonryStyle::dry,
        Some(other) => panic!("{other}: dry, or nothing"),
    };
    let mut table: BTreeMap<(usize, usize), Score> = BTreeMap::new();

    eprintln!("seed,references,recalled,found,right,iou_sum");
    for seed in first..first + count {
        let survey = kind.map(|kind| Survey::random(kind, seed));
        let style = style(seed, SIDE_PX, SIDE_PX);
        let wall = masonry_photo_of(&style, survey.as_ref(), seed, SIDE_PX, SIDE_PX);
        let mut of_wall = BTreeMap::new();
        score(&detector, &wall, &options, &mut of_wall);
        let all: &Score = of_wall.entry((0, 0)).or_default();
        let counts = [all.references, all.recalled, all.found, all.right].map(|n| n.to_string());
        eprintln!("{seed},{},{:.4}", counts.join(","), all.iou);
        for (class, score) in of_wall {
            table.entry(class).or_default().add(&score);
        }
    }

    println!(
        "seeds {first} to {}, {SIDE_PX} x {SIDE_PX} px\n",
        first + count - 1
    );
    let printed = Table::begin(["", "stones", "precision", "recall", "F1", "mean IoU"]);
    let names: [&[(f64, &str)]; 4] = [&ALL, &SIZES, &LIGHTS, &CONTRASTS];
    for ((group, class), score) in &table {
        printed.row(std::iter::once(names[*group][*class].1.to_owned()).chain(score.cells()));
    }
    Ok(())
}

#[derive(Default)]
struct Score {
    references: usize,
    recalled: usize,
    found: usize,
    right: usize,
    iou: f64,
}

impl Score {
    fn add(&mut self, other: &Self) {
        self.references += other.references;
        self.recalled += other.recalled;
        self.found += other.found;
        self.right += other.right;
        self.iou += other.iou;
    }

    fn cells(&self) -> [String; 5] {
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let precision = share(self.right, self.found);
        let recall = share(self.recalled, self.references);
        let f1 = 2.0 * precision * recall / (precision + recall).max(f64::MIN_POSITIVE);
        let iou = self.iou / self.right.max(1) as f64;
        let [precision, recall, f1, iou] = [precision, recall, f1, iou].map(|v| format!("{v:.2}"));
        [self.references.to_string(), precision, recall, f1, iou]
    }
}

/// Adds a wall to the table, whose keys are group and class.
fn score(
    detector: &StoneFinder,
    wall: &Sample,
    options: &TilingOptions,
    table: &mut BTreeMap<(usize, usize), Score>,
) {
    let found = segment_photo(detector, wall.image(), 1.0, wall.relief(), options, &Silent);
    let found = found.expect("the detector takes every wall");
    let pairs = pair_masks(&found, wall.labels(), wall.ignore());
    let own = stones(wall.labels(), wall.image());
    let theirs = stones(&found.labels, wall.image());
    let recalled: BTreeSet<u32> = pairs.found.iter().filter_map(|f| f.reference).collect();
    for r in &pairs.references {
        for key in own[r].classes() {
            let score = table.entry(key).or_default();
            score.references += 1;
            score.recalled += usize::from(recalled.contains(r));
        }
    }
    for stone in pairs.found.iter().filter(|stone| stone.counts()) {
        for key in theirs[&stone.label].classes() {
            let score = table.entry(key).or_default();
            score.found += 1;
            score.right += usize::from(stone.iou.is_some());
            score.iou += stone.iou.unwrap_or(0.0);
        }
    }
}

/// A stone as a photo shows it.
#[derive(Default)]
struct Stone {
    pixels: usize,
    luminance: f64,
    joint_pixels: usize,
    joint_luminance: f64,
}

impl Stone {
    /// Group and class: all, by size, by light, by contrast of the joint.
    fn classes(&self) -> [(usize, usize); 4] {
        let of = |value: f64, classes: &[(f64, &str)]| classes.iter().position(|c| value < c.0).unwrap_or(0);
        let light = self.luminance / self.pixels as f64;
        let joint = match self.joint_pixels {
            0 => light,
            n => self.joint_luminance / n as f64,
        };
        [
            (0, 0),
            (1, of((self.pixels as f64).sqrt(), &SIZES)),
            (2, of(light, &LIGHTS)),
            (3, of((light - joint).abs(), &CONTRASTS)),
        ]
    }
}

/// Every stone of a label image; its joint is what lies within a few pixels of it and belongs to no stone.
fn stones(labels: &LabelImage, image: &RgbImage) -> BTreeMap<u32, Stone> {
    let luminance = |x: u32, y: u32| {
        let [r, g, b] = image.get(x, y).copied().unwrap_or_default().map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let mut stones: BTreeMap<u32, Stone> = BTreeMap::new();

    for y in 0..labels.height() {
        for x in 0..labels.width() {
            let label = labels.get(x, y).copied().unwrap_or(0);
            if label != 0 {
                let stone = stones.entry(label).or_default();
                stone.pixels += 1;
                stone.luminance += luminance(x, y);
                continue;
            }
            let mut around = BTreeSet::new();
            for dy in -JOINT_PX..=JOINT_PX {
                for dx in -JOINT_PX..=JOINT_PX {
                    let place = [i64::from(x) + dx, i64::from(y) + dy].map(u32::try_from);
                    if let [Ok(x), Ok(y)] = place {
                        around.extend(labels.get(x, y).copied().filter(|l| *l != 0));
                    }
                }
            }
            for label in around {
                let stone = stones.entry(label).or_default();
                stone.joint_pixels += 1;
                stone.joint_luminance += luminance(x, y);
            }
        }
    }

    stones
}
