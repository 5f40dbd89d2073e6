//! Relief beside colour: weights of colour alone do what they did, and relief can be learnt.

use safetensors::SafeTensors;
use std::collections::HashMap;
use stonewise_core::raster::{LabelImage, Raster, ReliefMap, RgbImage};
use stonewise_segment::model::{
    MaskRcnn, MaskRcnnConfig, Precision, config_from_bytes, model_from_bytes, weights_to_bytes,
};
use stonewise_segment::train::synth::{Survey, SurveyKind, masonry_photo, surveyed_photo_by};
use stonewise_segment::train::{AdamW, AdamWParams};
use stonewise_segment::{Sample, Weights};

const SIDE: u32 = 160;

/// The built-in weights as a file for colour alone: without the tensors of relief.
fn of_colour_alone() -> Vec<u8> {
    let bytes = Weights::BuiltIn.bytes().unwrap();
    let config = MaskRcnnConfig {
        relief_channels: 0,
        ..config_from_bytes(&bytes, "built-in").unwrap()
    };
    let metadata = HashMap::from([(
        "stonewise_model".to_owned(),
        serde_json::to_string(&config).unwrap(),
    )]);
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let tensors = file.tensors().into_iter();
    let of_colour = tensors.filter(|(name, _)| !name.starts_with("backbone.relief."));
    safetensors::serialize(of_colour, Some(metadata)).unwrap()
}

fn opened(bytes: &[u8], relief: bool) -> MaskRcnn {
    model_from_bytes(bytes, "weights", relief).unwrap()
}

#[test]
fn weights_of_colour_alone_see_no_relief_to_the_bit() {
    let photo = surveyed_photo_by(Some(&Survey::random(SurveyKind::Terrestrial, 4)), 4, SIDE, SIDE);
    let relief = photo.relief().unwrap();
    let bytes = of_colour_alone();
    let (colour, wider) = (opened(&bytes, false), opened(&bytes, true));
    let expected = colour.instances(photo.image(), None);
    assert!(!expected.is_empty());
    assert_eq!(colour.instances(photo.image(), Some(relief)), expected);
    assert_eq!(wider.instances(photo.image(), None), expected);
    assert_eq!(wider.instances(photo.image(), Some(relief)), expected);
}

#[test]
fn a_file_says_how_many_channels_its_model_takes() {
    assert!(Weights::BuiltIn.takes_relief().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let takes_relief = |bytes: &[u8]| {
        let path = folder.path().join("model.safetensors");
        std::fs::write(&path, bytes).unwrap();
        Weights::File(path).takes_relief().unwrap()
    };
    let bytes = of_colour_alone();
    assert_eq!(config_from_bytes(&bytes, "colour").unwrap().relief_channels, 0);
    assert!(!takes_relief(&bytes));
    let bytes = weights_to_bytes(&opened(&bytes, true), Precision::Half).unwrap();
    assert_eq!(config_from_bytes(&bytes, "wider").unwrap().relief_channels, 4);
    assert!(takes_relief(&bytes));
    // The configuration of a model of colour alone does not mention relief.
    let text = serde_json::to_string(&MaskRcnnConfig::light()).unwrap();
    assert!(!text.contains("relief"), "{text}");
}

#[test]
fn clouds_change_nothing_about_photos() {
    let mut without = 0;
    for seed in 0..30 {
        let survey = Survey::sometimes(seed);
        let photo = || surveyed_photo_by(survey.as_ref(), seed, 96, 96);
        let (plain, surveyed) = (masonry_photo(seed, 96, 96), photo());
        without += u32::from(surveyed.relief().is_none());
        assert_eq!(surveyed.clone().with_relief(None), plain);
        assert_eq!(photo(), surveyed);
    }
    assert!(
        (8..=18).contains(&without),
        "{without} of 30 photos have no cloud"
    );
}

/// Joints lie lower than stones in the map of a dense, exact cloud of most walls: 27 of 38 when this was
/// written. Some walls have proud or flush joints, and what stands before or beside a wall is no stone
/// either.
#[test]
fn joints_lie_lower_than_stones() {
    let (mut right, mut walls) = (0, 0);
    for seed in 0..40 {
        let survey = Survey {
            gaps: 0.0,
            noise_m: 0.001,
            spacing_m: 0.003,
            shift_px: [0.0; 2],
            ..Survey::random(SurveyKind::Drone, seed)
        };
        let photo = surveyed_photo_by(Some(&survey), seed, SIDE, SIDE);
        let relief = photo.relief().unwrap();
        let mut means = [[0.0; 2]; 2];
        for (i, value) in relief.data().iter().enumerate() {
            let (x, y) = (i as u32 % relief.width(), i as u32 / relief.width());
            let (label, ignored) = (photo.labels().get(2 * x, 2 * y), photo.ignore().get(2 * x, 2 * y));
            if value[3] > 0.4 && ignored == Some(&false) {
                let mean = &mut means[usize::from(label != Some(&0))];
                *mean = [mean[0] + 1.0, mean[1] + f64::from(value[0])];
            }
        }
        let [joint, stone] = means;
        if joint[0] > 300.0 && stone[0] > 300.0 {
            walls += 1;
            right += u32::from(stone[1] / stone[0] > joint[1] / joint[0]);
        }
    }
    assert!(walls > 20 && 10 * right >= 6 * walls, "{right} of {walls} walls");
}

/// Left and top of the squares, pixels.
const SQUARES: [[u32; 2]; 4] = [[8, 8], [56, 12], [14, 54], [52, 56]];
/// Their side.
const SQUARE: u32 = 30;

/// Squares that stand out by relief alone: every pixel of the image has the same colour but for noise.
fn hidden_squares() -> Sample {
    let noise = |i: u32| [(90 + i.wrapping_mul(2_654_435_761) % 60) as u8; 3];
    let image: RgbImage = Raster::from_vec(96, 96, (0..96 * 96).map(noise).collect()).unwrap();
    let mut labels: LabelImage = Raster::filled(96, 96, 0);
    let mut relief: ReliefMap = Raster::filled(48, 48, [-0.5, -0.3, 0.0, 1.0]);
    for [left, top] in SQUARES {
        for (x, y) in (0..SQUARE).flat_map(|y| (0..SQUARE).map(move |x| (left + x, top + y))) {
            *labels.get_mut(x, y).unwrap() = 1 + left * 100 + top;
            *relief.get_mut(x / 2, y / 2).unwrap() = [0.5, 0.3, 0.0, 1.0];
        }
    }
    Sample::new(image, labels, Raster::filled(96, 96, false))
        .unwrap()
        .with_relief(Some(relief))
}

#[test]
fn stones_that_only_relief_shows_are_learnt() {
    let config = crate::narrow_model::narrow(16).with_relief();
    let sample = hidden_squares();
    let mut model = MaskRcnn::init(&config, 1).unwrap();
    let mut optimizer = AdamW::new(AdamWParams::default());
    let batch = [sample];
    for step in 0..80 {
        let (_, gradients) = model.gradients(&batch, step);
        optimizer.step(&mut model, gradients, 3e-3);
    }
    let found = model.detect(batch[0].image(), batch[0].relief());
    // The most probable four are the four squares; a few parts of squares may follow.
    let square_of = |bounds: [f32; 4]| {
        SQUARES.iter().position(|square| {
            let [left, top] = square.map(|side| side as f32);
            let side = SQUARE as f32;
            let width = (bounds[2].min(left + side) - bounds[0].max(left)).max(0.0);
            let height = (bounds[3].min(top + side) - bounds[1].max(top)).max(0.0);
            let area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]);
            let shared = width * height;
            shared > 0.5 * (area + side * side - shared)
        })
    };
    let best: Vec<(f32, Option<usize>)> = found[..4]
        .iter()
        .map(|d| (d.score, square_of(d.bounds)))
        .collect();
    let mut squares: Vec<usize> = best.iter().filter_map(|b| b.1).collect();
    squares.sort_unstable();
    assert_eq!(squares, [0, 1, 2, 3], "{best:?}");
    assert!(best.iter().all(|b| b.0 > 0.5), "{best:?}");
}
