//! A whole training of a tiny detector: it learns, resumes to the bit, and stops when it diverges.

use super::*;
use crate::Sample;
use crate::model::{BackboneConfig, MaskRcnnConfig, Norm, ResnetConfig, ResnetDepth, RoiConfig};
use std::path::Path;
use stonewise_core::progress::Silent;
use stonewise_core::raster::Raster;

fn config() -> MaskRcnnConfig {
    let light = MaskRcnnConfig::light();
    MaskRcnnConfig {
        backbone: BackboneConfig::Resnet(ResnetConfig {
            depth: ResnetDepth::R18,
            width: 8,
            norm: Norm::Group { groups: 4 },
        }),
        fpn_channels: 8,
        head_groups: Some(4),
        roi: RoiConfig {
            box_hidden: 16,
            mask_channels: vec![8],
            ..light.roi
        },
        ..light
    }
}

fn params() -> TrainParams {
    TrainParams {
        crop_px: 64,
        evaluate_steps: 0,
        schedule: Schedule {
            learning_rate: 2e-3,
            warmup_steps: 2,
            decay_share: 0.5,
        },
        ..TrainParams::default()
    }
}

/// A bright square on a dark ground; its place depends on the number.
fn square(number: u64) -> Result<Sample, String> {
    let (left, top) = ((number * 7 % 24) as u32 + 8, (number * 5 % 24) as u32 + 8);
    let (mut image, mut labels) = (Raster::filled(64, 64, [40u8; 3]), Raster::filled(64, 64, 0u32));
    for y in top..top + 24 {
        for x in left..left + 24 {
            *image.get_mut(x, y).unwrap() = [220, 200, 180];
            *labels.get_mut(x, y).unwrap() = 1;
        }
    }
    Sample::new(image, labels, Raster::filled(64, 64, false)).map_err(|e| e.to_string())
}

fn train(out: &Path, total: u64, until: u64) -> (Stop, Trainer) {
    let start = Start::Nothing(Box::new(config()));
    let total = Some(Total::Steps(total));
    let mut trainer = open_training(out, &start, Some(params()), total, None).unwrap();
    // The source ends the training where a user would press Ctrl-C.
    let stopper = StopAfter {
        steps: std::sync::atomic::AtomicU64::new(until + 1 - trainer.elapsed().steps),
    };
    let run = Run {
        source: &square,
        validation: &[],
        out,
        minutes: None,
        threads: 1,
        progress: &stopper,
    };
    let stop = run.train(&mut trainer).unwrap();
    (stop, trainer)
}

/// Cancels at the call of this number.
struct StopAfter {
    steps: std::sync::atomic::AtomicU64,
}

impl stonewise_core::progress::Progress for StopAfter {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn is_cancelled(&self) -> bool {
        self.steps.fetch_sub(1, std::sync::atomic::Ordering::SeqCst) == 1
    }
}

#[test]
fn a_training_in_two_runs_is_the_training_in_one() {
    let [whole, parts] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let (stop, trainer) = train(whole.path(), 6, 100);
    assert_eq!((stop, trainer.elapsed().steps), (Stop::Finished, 6));
    let (stop, trainer) = train(parts.path(), 6, 4);
    assert_eq!((stop, trainer.elapsed().steps), (Stop::Interrupted, 4));
    assert_eq!(train(parts.path(), 6, 100).0, Stop::Finished);
    let read = |dir: &Path| std::fs::read(model_path(dir)).unwrap();
    assert!(read(whole.path()) == read(parts.path()), "weights differ");
    let steps = |dir: &Path| {
        let rows = curve::read_curve(&dir.join("loss.csv")).unwrap();
        rows.iter().map(|r| (r[0], r[5..].to_vec())).collect::<Vec<_>>()
    };
    assert_eq!(steps(whole.path()).len(), 6);
    assert_eq!(steps(whole.path()), steps(parts.path()));
    // Every column has a meaning, and times have a unit.
    for name in ["loss", "validation"] {
        let csv = std::fs::read_to_string(parts.path().join(format!("{name}.csv"))).unwrap();
        let metadata = std::fs::read(parts.path().join(format!("{name}.csv-metadata.json"))).unwrap();
        let metadata: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
        let columns = metadata["tableSchema"]["columns"].as_array().unwrap();
        let names: Vec<&str> = columns.iter().filter_map(|c| c["name"].as_str()).collect();
        assert_eq!(csv.lines().next(), Some(names.join(",").as_str()));
        assert!(
            columns
                .iter()
                .all(|c| !c["dc:description"].as_str().unwrap().is_empty())
        );
        assert_eq!(columns[1]["schema:unitText"], "s");
    }
}

#[test]
fn the_loss_falls() {
    let out = tempfile::tempdir().unwrap();
    train(out.path(), 40, 100);
    let rows = curve::read_curve(&out.path().join("loss.csv")).unwrap();
    let mean = |rows: &[Vec<f64>]| rows.iter().map(|r| r[10]).sum::<f64>() / rows.len() as f64;
    assert!(
        mean(&rows[35..]) < 0.7 * mean(&rows[..5]),
        "{} {}",
        mean(&rows[..5]),
        mean(&rows[35..])
    );
}

#[test]
fn other_parameters_do_not_continue_a_training() {
    let out = tempfile::tempdir().unwrap();
    train(out.path(), 1, 100);
    let other = TrainParams { seed: 9, ..params() };
    let start = Start::Nothing(Box::new(config()));
    let opened = open_training(out.path(), &start, Some(other), None, None);
    assert!(opened.err().unwrap().to_string().contains("other parameters"));
}

#[test]
fn a_training_that_diverges_stops_and_says_so() {
    let out = tempfile::tempdir().unwrap();
    let wild = TrainParams {
        schedule: Schedule {
            learning_rate: 1e30,
            warmup_steps: 1,
            decay_share: 0.5,
        },
        ..params()
    };
    let start = Start::Nothing(Box::new(config()));
    let total = Some(Total::Steps(20));
    let mut trainer = open_training(out.path(), &start, Some(wild), total, None).unwrap();
    let run = Run {
        source: &square,
        validation: &[],
        out: out.path(),
        minutes: None,
        threads: 1,
        progress: &Silent,
    };
    let error = run.train(&mut trainer).unwrap_err().to_string();
    assert!(
        error.contains("diverged") && error.contains("learning_rate"),
        "{error}"
    );
}
