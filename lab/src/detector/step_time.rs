//! Times training steps and detections of the light model on a made-up wall: `step_time [SIDE] [STEPS]`.

use crate::Outcome;
use crate::words::Words;
use std::time::Instant;
use stonewise_core::raster::{LabelImage, Raster, RgbImage};
use stonewise_segment::Sample;
use stonewise_segment::model::{MaskRcnn, MaskRcnnConfig};
use stonewise_segment::train::{AdamW, AdamWParams};

/// Blocks with rounded corners in courses, about 60 of them.
fn wall(side: u32, seed: u32) -> Sample {
    let mut labels: LabelImage = Raster::filled(side, side, 0);
    let mut image: RgbImage = Raster::filled(side, side, [60, 55, 50]);
    let pitch = [side / 7, side / 9];
    for y in 0..side {
        for x in 0..side {
            let row = y / pitch[1];
            let shifted = x + (row % 2) * pitch[0] / 2;
            let column = shifted / pitch[0];
            let at = |v: u32, pitch: u32| 2.0 * f64::from(v % pitch) / f64::from(pitch) - 1.0;
            let (u, v) = (at(shifted, pitch[0]), at(y, pitch[1]));
            if u.powi(6) + v.powi(6) < 0.6 {
                let place = (y * side + x) as usize;
                labels.data_mut()[place] = 1 + row * 64 + column;
                let noise = (x * 7919 + y * 104_729 + seed * 31) % 23;
                let tint = (row * 37 + column * 101 + seed * 13) % 90;
                image.data_mut()[place] = [
                    (100 + tint + noise) as u8,
                    (90 + tint + noise) as u8,
                    (80 + tint / 2) as u8,
                ];
            }
        }
    }
    Sample::new(image, labels, Raster::filled(side, side, false)).expect("equal sizes")
}

pub fn run(words: &Words) -> Outcome {
    let [side, steps] = [(0, 384), (1, 4)].map(|(place, or)| words.number_at::<u32>(place).unwrap_or(or));
    let config = MaskRcnnConfig::light();
    let mut model = MaskRcnn::init(&config, 1)?;
    let mut optimizer = AdamW::new(AdamWParams::default());
    for step in 0..steps {
        let sample = [wall(side, step)];
        let start = Instant::now();
        let (losses, gradients) = model.gradients(&sample, u64::from(step));
        let computed = start.elapsed();
        optimizer.step(&mut model, gradients, 1e-3);
        let update = start.elapsed() - computed;
        println!(
            "step {step}: loss {:.3}, gradients {computed:.2?}, update {update:.2?}",
            losses.total()
        );
    }
    let model = model.for_inference();
    for step in 0..2 {
        let start = Instant::now();
        let found = model.detect(wall(side, step).image(), None);
        println!("{} detections in {:.2?}", found.len(), start.elapsed());
    }
    Ok(())
}
