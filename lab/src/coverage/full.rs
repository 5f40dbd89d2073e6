//! Simulates the surveys of which coverage is measured with scanned walls and the whole adjustment: slow, and a check
//! of the small walls.

use super::errors::{Kind, Sensor};
use super::small_wall::{Case, Survey};
use crate::survey::ScannedWall;
use stonewise_simulate::{SceneParams, StripDrift, TlsParams, UavParams, WallMotion, WallParams};

fn params(case: &Case, seed: u64) -> SceneParams {
    let uav = UavParams {
        strips: case.sources,
        datum_m: 2e-3,
        drift_m: 3e-3,
        drift: match case.kind {
            Kind::Walk => StripDrift::RandomWalk,
            Kind::Sine => StripDrift::Sine,
            Kind::Jump => StripDrift::Jump,
            _ => StripDrift::Smooth,
        },
        adjusted: case.kind == Kind::Adjusted,
        spacing_m: 0.012,
        ..UavParams::default()
    };

    let tls = TlsParams {
        stations: case.sources,
        registration_m: 4e-4,
        datum_m: 3e-4,
        scale_error: if case.kind == Kind::Scale { 5e-5 } else { 0.0 },
        spacing_m: 0.007,
        ..TlsParams::default()
    };
    let bulge = WallMotion::Bulge {
        centre_m: [0.2, 1.0],
        depth_m: 0.02,
        diameter_m: 1.5,
    };

    SceneParams {
        wall: WallParams::sized([3.0, 2.0]),
        motions: vec![bulge],
        tls: (case.sensor == Sensor::Tls).then_some(tls),
        uav: (case.sensor == Sensor::Uav).then_some(uav),
        ..SceneParams::default()
    }
    .seeded(seed)
}

pub fn simulate(case: &Case, seed: u64) -> Survey {
    let wall = ScannedWall::new(&params(case, seed), case.sources);
    let mut survey = Survey {
        sources: wall.sources(),
        stones: Vec::new(),
        stable: Vec::new(),
        sigma_m: wall.sigma_m(),
        seeming: Vec::new(),
        measured: Vec::new(),
        noise: Vec::new(),
    };
    for result in &wall.report.results {
        let Ok(motion) = &result.motion else { continue };
        let stone = wall.seen(result.first);
        let error = motion.displacement - wall.truth(result.first, stone.centroid);
        survey.measured.push(error);
        survey.seeming.push(error);
        survey
            .noise
            .push(motion.covariance.fixed_view::<3, 3>(0, 0).into_owned());
        survey.stones.push(stone);
    }
    survey
}
