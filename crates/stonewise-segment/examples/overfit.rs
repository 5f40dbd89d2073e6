//! Learns a few rendered photos by heart: `overfit [PHOTOS] [SIDE] [STEPS]`. Losses fall and AP50 nears 1 where losses,
//! matching and the gradients of RoIAlign are right.
#![allow(clippy::expect_used, clippy::print_stdout)]

use burn::backend::{Autodiff, Flex};
use burn::grad_clipping::GradientClippingConfig;
use burn::module::AutodiffModule;
use burn::optim::{AdamWConfig, GradientsParams, Optimizer};
use std::time::Instant;
use stonewise_core::progress::Silent;
use stonewise_segment::Sample;
use stonewise_segment::evaluation::{MaskScore, pair_masks};
use stonewise_segment::model::{MaskRcnn, MaskRcnnConfig, StoneDetector};
use stonewise_segment::synth::masonry_photo;
use stonewise_segment::tiling::{TilingOptions, segment_photo};

/// Photos that a step learns from.
const BATCH: usize = 1;

fn main() {
    let mut args = std::env::args()
        .skip(1)
        .map(|arg| arg.parse::<u32>().expect("a number"));
    let mut arg = |default| args.next().unwrap_or(default);
    let (photos, side, steps) = (arg(4), arg(320), arg(200));
    let samples: Vec<Sample> = (0..photos)
        .map(|seed| masonry_photo(u64::from(seed), side, side))
        .collect();
    let config = MaskRcnnConfig::light();
    let mut model =
        MaskRcnn::<Autodiff<Flex>>::init(&config, 1, &Default::default()).expect("a valid preset");
    let mut optimizer = AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(1.0)))
        .init();
    let start = Instant::now();
    for step in 0..steps as usize {
        let chosen: Vec<Sample> = (0..BATCH)
            .map(|i| samples[(step * BATCH + i) % samples.len()].clone())
            .collect();
        let losses = model.losses(&chosen, step as u64);
        let total = losses.total();
        let gradients = GradientsParams::from_grads(total.backward(), &model);
        let progress = (step as f64 + 1.0) / f64::from(steps);
        let rate =
            5e-4 * (step as f64 / 20.0).min(1.0) * (0.5 + 0.5 * (std::f64::consts::PI * progress).cos());
        model = optimizer.step(rate, model, gradients);
        if step % 20 == 0 {
            let parts = [
                losses.rpn_objectness,
                losses.rpn_box,
                losses.class,
                losses.box_regression,
                losses.mask,
            ];
            let parts = parts.map(|part| format!("{:.3}", part.into_scalar())).join(" ");
            println!(
                "{step}: {:.3} = {parts}, {:.0?}",
                total.into_scalar(),
                start.elapsed()
            );
        }
    }
    let detector = StoneDetector::new(model.valid());
    let pairs: Vec<_> = samples
        .iter()
        .map(|sample| {
            let options = TilingOptions {
                min_score: 0.05,
                ..TilingOptions::whole(sample.image())
            };
            let found =
                segment_photo(&detector, sample.image(), &options, &Silent).expect("nothing stops it");
            pair_masks(&found, sample.labels(), sample.ignore())
        })
        .collect();
    println!("{:?}", MaskScore::of(&pairs));
}
