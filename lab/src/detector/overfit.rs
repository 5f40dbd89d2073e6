//! Learns a few rendered photos by heart: `lab overfit [PHOTOS] [SIDE] [STEPS] [WEIGHTS]`. Losses fall and AP50
//! nears 1 where losses, matching and the gradients of RoIAlign are right. `WEIGHTS` is `none`, `built-in` or
//! a file of `train`.

use crate::Outcome;
use crate::words::Words;
use std::collections::BTreeMap;
use std::time::Instant;
use stonewise_core::progress::Silent;
use stonewise_segment::Sample;
use stonewise_segment::evaluation::{MaskScore, pair_masks};
use stonewise_segment::model::{MaskRcnn, MaskRcnnConfig};
use stonewise_segment::tiling::{TilingOptions, segment_photo};
use stonewise_segment::train::synth::masonry_photo;
use stonewise_segment::train::{AdamW, AdamWParams};
use stonewise_segment::{StoneFinder, Weights, open_model};

/// Photos that a step learns from.
const BATCH: usize = 1;

pub fn run(words: &Words) -> Outcome {
    let [photos, side, steps] =
        [(0, 4), (1, 320), (2, 200)].map(|(place, or)| words.number_at::<u32>(place).unwrap_or(or));
    let samples: Vec<Sample> = (0..photos)
        .map(|seed| known(&masonry_photo(u64::from(seed), side, side)))
        .collect();
    let mut model = match words.as_slice().get(3).map(String::as_str) {
        None | Some("none") => MaskRcnn::init(&MaskRcnnConfig::light(), 1)?,
        Some(weights) => open_model(&Weights::named(weights.as_ref()), false)?,
    };
    let mut optimizer = AdamW::new(AdamWParams::default());
    let start = Instant::now();

    for step in 0..steps as usize {
        let chosen: Vec<Sample> = (0..BATCH)
            .map(|i| samples[(step * BATCH + i) % samples.len()].clone())
            .collect();
        let (losses, gradients) = model.gradients(&chosen, step as u64);
        let progress = (step as f64 + 1.0) / f64::from(steps);
        let rate =
            5e-4 * (step as f64 / 20.0).min(1.0) * (0.5 + 0.5 * (std::f64::consts::PI * progress).cos());
        optimizer.step(&mut model, gradients, rate);
        if step % 20 == 0 {
            let parts = losses.parts().map(|part| format!("{part:.3}")).join(" ");
            println!("{step}: {:.3} = {parts}, {:.0?}", losses.total(), start.elapsed());
        }
    }

    let detector = StoneFinder::new(model);
    let pairs: Vec<_> = samples
        .iter()
        .map(|sample| {
            let options = TilingOptions {
                min_score: 0.05,
                ..TilingOptions::whole(sample.image())
            };
            let found = segment_photo(&detector, sample.image(), 1.0, None, &options, &Silent)
                .expect("nothing stops it");
            pair_masks(&found, sample.labels(), sample.ignore())
        })
        .collect();
    println!("{:?}", MaskScore::of(&pairs));

    Ok(())
}

/// The sample with stones that are too small to be reported taken as unknown.
fn known(sample: &Sample) -> Sample {
    let least = TilingOptions::default().min_area_px;
    let mut areas: BTreeMap<u32, u32> = BTreeMap::new();
    for label in sample.labels().data() {
        *areas.entry(*label).or_default() += 1;
    }
    let mut ignore = sample.ignore().clone();
    for (unknown, label) in ignore.data_mut().iter_mut().zip(sample.labels().data()) {
        *unknown |= *label > 0 && areas[label] < least;
    }
    Sample::new(sample.image().clone(), sample.labels().clone(), ignore).expect("the same size")
}
