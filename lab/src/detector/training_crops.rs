//! Rendered photos as files, for the training in `lab/detector`: `training-crops DIR FIRST COUNT [SIDE]`, with
//! FIRST and COUNT of the photos of `stonewise detector train --rendered` with relief.
//!
//! Three PNG files a photo: `N.photo.png`; `N.labels.png`, whose bits 0 to 14 are the stone (0 = none) and whose
//! bit 15 is set where nothing is known; `N.relief.png` where the photo has relief, of whose channels the first
//! two have 0 to 255 for -1 to 1, the others for 0 to 1. Photos that are there are left as they are.

use crate::Outcome;
use crate::words::Words;
use image::{ImageBuffer, Luma, RgbImage, RgbaImage};
use std::path::Path;
use stonewise_segment::Sample;
use stonewise_segment::train::{Rendered, SampleSource};

/// Seed of the photos; those of the trainings up to run 8 were 1 to 5.
const SEED: u64 = 6;
const SIDE_PX: u32 = 384;

pub fn run(words: &Words) -> Outcome {
    let missing = "say where to write, the first number and how many";
    let folder = Path::new(words.as_slice().first().ok_or(missing)?);
    let first: u64 = words.number_at(1).ok_or(missing)?;
    let count: u64 = words.number_at(2).ok_or(missing)?;
    let side: u32 = words.number_at(3).unwrap_or(SIDE_PX);
    let photos = Rendered {
        seed: SEED,
        size_px: side,
        relief: true,
    };
    std::fs::create_dir_all(folder)?;
    for number in first..first + count {
        let stem = folder.join(format!("{number:06}"));
        if stem.with_extension("labels.png").exists() {
            continue;
        }
        write(&photos.sample(number)?, &stem)?;
    }
    Ok(())
}

/// Writes the files of a photo, the labels last: where they are, the others are complete.
fn write(sample: &Sample, stem: &Path) -> Outcome {
    let [width, height] = [sample.labels().width(), sample.labels().height()];
    let colours = sample.image().data().as_flattened().to_vec();
    RgbImage::from_raw(width, height, colours)
        .ok_or("size of the photo")?
        .save(stem.with_extension("photo.png"))?;

    if let Some(relief) = sample.relief() {
        let values = relief.data().iter().flat_map(|&[near, wide, slope, confidence]| {
            let values = [(near + 1.0) / 2.0, (wide + 1.0) / 2.0, slope, confidence];
            values.map(|value| (value * 255.0).round() as u8)
        });
        RgbaImage::from_raw(relief.width(), relief.height(), values.collect())
            .ok_or("size of the relief")?
            .save(stem.with_extension("relief.png"))?;
    }

    let pixels = sample.labels().data().iter().zip(sample.ignore().data());
    let coded = pixels.map(|(&label, &unknown)| label as u16 | u16::from(unknown) << 15);
    ImageBuffer::<Luma<u16>, _>::from_raw(width, height, coded.collect::<Vec<u16>>())
        .ok_or("size of the labels")?
        .save(stem.with_extension("labels.png"))?;
    Ok(())
}
