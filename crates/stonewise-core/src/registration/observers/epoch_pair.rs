//! Input of the comparison of two epochs: sources, stones, surfaces and parameters.

use super::contrast::ContrastParams;
use super::network::PhotoNetwork;
use super::observation::Observation;
use super::response::Response;
use super::scale::KnownScale;
use super::sight::{SeenStone, Sight, Source, Target};
use super::stable::{StableParams, StablePoints};
use crate::params::{Params, Range, Ranged, with_ranges};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`epoch_errors`](super::epoch_errors).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct EpochErrorParams {
    /// Comparison of the sources of an epoch.
    pub contrasts: ContrastParams,
    /// Planes in stable areas.
    pub stable: StableParams,
    /// Error that all sources of an epoch share, 1 sigma per axis, metres; absent: by the class of the
    /// sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shared_error_m: Option<f64>,
    /// Non-rigid part of the registration error of an epoch whose files keep no stations or strips apart,
    /// 1 sigma per axis, metres; absent: by the class of the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub merged_error_m: Option<f64>,
}

impl Params for EpochErrorParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("shared_error_m", self.shared_error_m),
            Range::NOT_NEGATIVE.holds("merged_error_m", self.merged_error_m),
        ]
    }

    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![("contrasts", &self.contrasts), ("stable", &self.stable)]
    }
}

/// What is measured and stated about two epochs.
pub struct EpochPair<'a> {
    /// Sources of both epochs.
    pub sources: &'a [Source],
    /// The stones.
    pub stones: &'a [SeenStone],
    /// Pairs of neighbours among them, as indices.
    pub neighbours: &'a [[usize; 2]],
    /// Points in stable areas.
    pub stable: &'a [StablePoints],
    /// Points on other surfaces off the wall. They do not enter the estimate; the error that they show is
    /// compared with it.
    pub offered: &'a [StablePoints],
    /// Noise of single points along the normal, metres.
    pub sigma_m: f64,
    /// What the motions follow of errors of the points; `None`: each stone its own.
    pub response: Option<Response<'a>>,
    /// Whether the later epoch was brought to the reference by the stones themselves: its sources then say nothing of the
    /// datum.
    pub is_aligned: bool,
    /// The photos from which clouds were computed, where they were.
    pub network: Option<&'a PhotoNetwork>,
    /// Whether a cloud was computed from photos that are not known: then an error of the class of such clouds is assumed.
    pub has_unknown_photos: bool,
    /// What is known of the epochs' scale; `None`: it is exact.
    pub scale: Option<KnownScale>,
}

impl<'a> EpochPair<'a> {
    /// Sources and stones alone; `sigma_m`: noise of single points.
    pub fn new(sources: &'a [Source], stones: &'a [SeenStone], sigma_m: f64) -> Self {
        Self {
            sources,
            stones,
            neighbours: &[],
            stable: &[],
            offered: &[],
            sigma_m,
            response: None,
            is_aligned: false,
            network: None,
            has_unknown_photos: false,
            scale: None,
        }
    }

    /// What the motions of the stones follow of these errors of their points, world, metres.
    pub(super) fn followed(&self, errors: Vec<Vec<Vector3<f64>>>) -> Vec<Vec<Vector3<f64>>> {
        let response = self.response.as_ref();
        response.and_then(|r| r.of(&errors)).unwrap_or(errors)
    }
}

/// All sights; they determine the blocks of the unknowns.
pub(super) fn all_sights(pair: &EpochPair, stable: &[Observation]) -> Vec<Sight> {
    let of_stone = |stone: &SeenStone| {
        let (centroid, normal) = (stone.centroid, stone.normal);
        stone
            .sights
            .iter()
            .map(|s| Sight {
                source: s.source,
                time_s: s.time_s,
                place: centroid,
                target: Target::Stone { normal },
            })
            .collect::<Vec<_>>()
    };
    let stones = pair.stones.iter().flat_map(of_stone);
    stones
        .chain(stable.iter().flat_map(|o| o.sights.clone()))
        .collect()
}
