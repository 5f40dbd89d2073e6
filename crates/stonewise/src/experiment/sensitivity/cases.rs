//! What is varied, one thing at a time.

use serde::Serialize;
use std::str::FromStr;
use stonewise_simulate::{
    MaskError, MaskFiles, PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, UavParams,
    WallMotion, WallParams,
};

/// What the results may depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Influence {
    /// Masks that are too small, too large, merged, split or missing.
    Masks,
    /// Range noise of the terrestrial scanner.
    Noise,
    /// Point spacing of the terrestrial scan.
    Spacing,
    /// Length of the motion, in the plane of the wall.
    Motion,
    /// Error of the photos' poses.
    Pose,
    /// Number of photos that show a stone.
    Overlap,
}

impl Influence {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Masks,
        Self::Noise,
        Self::Spacing,
        Self::Motion,
        Self::Pose,
        Self::Overlap,
    ];

    /// Its word on the command line and in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Masks => "masks",
            Self::Noise => "noise",
            Self::Spacing => "spacing",
            Self::Motion => "motion",
            Self::Pose => "pose",
            Self::Overlap => "overlap",
        }
    }

    /// Label of the axis on which it is drawn.
    pub(super) fn axis(self) -> &'static str {
        match self {
            Self::Masks => "mean IoU of the masks",
            Self::Noise => "range noise (mm)",
            Self::Spacing => "point spacing (mm)",
            Self::Motion => "motion in the plane (mm)",
            Self::Pose => "pose error (px)",
            Self::Overlap => "photos",
        }
    }
}

impl FromStr for Influence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let words = Self::ALL.map(Self::word).join(", ");
        Self::ALL
            .into_iter()
            .find(|i| i.word() == text)
            .ok_or_else(|| format!("no such influence; there are {words}"))
    }
}

/// One thing that differs from the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) enum Change {
    /// Nothing does.
    None,
    /// The masks of both epochs.
    Masks(MaskError),
    /// Range noise, metres.
    Noise(f64),
    /// Spacing, metres.
    Spacing(f64),
    /// Length of the motion, metres.
    Motion(f64),
    /// Error of the poses, pixels.
    Pose(f64),
    /// Number of photos of each epoch.
    Photos(usize),
}

/// A variant of the base survey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Variant {
    pub influence: Influence,
    /// Which curve it belongs to; empty where the influence has one.
    pub kind: &'static str,
    pub change: Change,
    /// Where it lies on the axis of the influence; masks are measured instead.
    pub x: f64,
}

/// Photos of an epoch of the base, columns and rows.
const PHOTOS: [u32; 2] = [4, 2];
/// Length of the base's motion in the plane, metres: the paper's 2 cm along and 5 cm up.
const SHIFT_M: f64 = 0.053_851_648_071;

/// All variants of an influence, the base among them.
pub(super) fn variants(influence: Influence) -> Vec<Variant> {
    let variant = |kind, change, x| Variant {
        influence,
        kind,
        change,
        x,
    };

    let along = |values: &[f64], scale: f64, change: fn(f64) -> Change| -> Vec<Variant> {
        values
            .iter()
            .map(|v| variant("", change(*v), scale * v))
            .collect()
    };

    match influence {
        Influence::Masks => {
            let kinds: [(&str, Vec<MaskError>); 5] = [
                ("eroded", [1, 2, 3, 5, 7].map(MaskError::Eroded).to_vec()),
                ("dilated", [1, 2, 4].map(MaskError::Dilated).to_vec()),
                ("merged", [0.1, 0.2, 0.4, 0.8].map(MaskError::Merged).to_vec()),
                ("split", [0.1, 0.2, 0.4, 0.8].map(MaskError::Split).to_vec()),
                ("missing", [0.1, 0.2, 0.35, 0.5].map(MaskError::Missing).to_vec()),
            ];
            kinds
                .into_iter()
                .flat_map(|(kind, errors)| {
                    let base = variant(kind, Change::None, 1.0);
                    let spoilt = errors
                        .into_iter()
                        .map(move |e| variant(kind, Change::Masks(e), f64::NAN));
                    std::iter::once(base).chain(spoilt).collect::<Vec<_>>()
                })
                .collect()
        }
        Influence::Noise => along(&[0.0005, 0.0015, 0.003, 0.006, 0.012, 0.02], 1e3, Change::Noise),
        Influence::Spacing => along(&[0.003, 0.005, 0.008, 0.012, 0.02], 1e3, Change::Spacing),
        Influence::Motion => along(&[0.0, 0.01, 0.03, 0.06, 0.1, 0.2, 0.4], 1e3, Change::Motion),
        Influence::Pose => along(&[0.0, 0.4, 1.0, 2.0, 4.0, 8.0], 1.0, Change::Pose),
        Influence::Overlap => [1, 2, 3, 4, 6, 8]
            .map(|n| variant("", Change::Photos(n), n as f64))
            .to_vec(),
    }
}

/// The survey from which everything differs: a wall without anything before it, both scanners, eight photos
/// at the paper's ground sampling distance, the paper's translation. Errors of registration and datum are
/// left out: they would add the same to everything.
pub(in crate::experiment) fn base([width_m, height_m]: [f64; 2], seed: u64) -> SurveyParams {
    let dam = SurveyParams::dam([width_m, height_m]);
    let side = |size_m: f64| ((size_m + 1.2) / 5.4e-3) as u32;
    let params = SurveyParams {
        name: "Sensitivity".to_owned(),
        masks: MaskFiles::Png,
        scene: SceneParams {
            wall: WallParams::sized([width_m, height_m]),
            surroundings: SurroundingsParams::none(),
            motions: vec![shift(SHIFT_M)],
            tls: Some(TlsParams {
                registration_m: 0.0,
                registration_rad: 0.0,
                ..TlsParams::default()
            }),
            uav: Some(UavParams {
                datum_m: 0.0,
                ..UavParams::default()
            }),
            ..SceneParams::default()
        },
        photos: PhotoParams {
            columns: PHOTOS[0],
            rows: PHOTOS[1],
            width: side(width_m),
            height: side(height_m),
            rendered: false,
            ..dam.photos.clone()
        },
        ..dam
    };
    params.seeded(seed)
}

/// The survey of a variant, where its clouds differ from the base's.
pub(super) fn changed(base: &SurveyParams, change: Change) -> SurveyParams {
    let mut params = base.clone();
    match (change, params.scene.tls.as_mut()) {
        (Change::Noise(sigma), Some(tls)) => tls.beam.range_noise_m = sigma,
        (Change::Spacing(spacing), Some(tls)) => tls.spacing_m = spacing,
        (Change::Motion(length), _) => params.scene.motions = vec![shift(length)],
        _ => {}
    }
    if matches!(change, Change::Noise(_) | Change::Spacing(_)) {
        params.scene.uav = None;
    }
    params
}

/// A translation of this length in the direction of the paper's.
fn shift(length_m: f64) -> WallMotion {
    let along_up = [0.02, 0.05].map(|v| v / SHIFT_M * length_m);
    WallMotion::Translation {
        d_m: [0.0, along_up[0], along_up[1]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_influence_varies_one_thing() {
        let base = base([3.0, 2.0], 1);
        assert!(base.check().is_ok());
        for influence in Influence::ALL {
            assert_eq!(influence.word().parse(), Ok(influence));
            let all = variants(influence);
            assert!(all.len() >= 5);
            for variant in all {
                let survey = changed(&base, variant.change);
                let clouds = matches!(
                    influence,
                    Influence::Noise | Influence::Spacing | Influence::Motion
                );
                let is_base = match variant.change {
                    Change::Noise(v) => v == base.scene.tls.as_ref().unwrap().beam.range_noise_m,
                    Change::Spacing(v) => v == base.scene.tls.as_ref().unwrap().spacing_m,
                    _ => false,
                };
                assert_eq!(
                    survey.scene.tls == base.scene.tls && survey.scene.motions == base.scene.motions,
                    !clouds || is_base
                );
            }
        }
        assert!("light".parse::<Influence>().unwrap_err().contains("masks"));
        let WallMotion::Translation { d_m } = shift(SHIFT_M) else {
            unreachable!()
        };
        assert!((d_m[1] - 0.02).abs() < 1e-12 && (d_m[2] - 0.05).abs() < 1e-12);
    }
}
