//! A whole simulated survey in memory: the wall, what it did, and the clouds of both epochs.

use crate::simulate::deform::{TrueMotion, WallMotion, move_stones};
use crate::simulate::noise::Noise;
use crate::simulate::props::{Prop, SurroundingsParams, surroundings};
use crate::simulate::scan::Scan;
use crate::simulate::scene::Scene;
use crate::simulate::surface::Surface;
use crate::simulate::tls::{TlsParams, scan_terrestrial};
use crate::simulate::uav::{UavParams, scan_airborne};
use crate::simulate::wall::{Wall, WallParams};
use serde::{Deserialize, Serialize};

/// Everything about the clouds of a simulated survey; equal parameters give equal bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneParams {
    /// The wall.
    pub wall: WallParams,
    /// What stands around it.
    pub surroundings: SurroundingsParams,
    /// What happened between the epochs; they add up.
    pub motions: Vec<WallMotion>,
    /// Terrestrial scanner; absent = no such cloud.
    #[serde(default)]
    pub tls: Option<TlsParams>,
    /// Scanner under a drone; absent = no such cloud.
    #[serde(default)]
    pub uav: Option<UavParams>,
    /// Seed of the motions and measurements; the wall and its surroundings have their own.
    pub seed: u64,
}

impl Default for SceneParams {
    fn default() -> Self {
        Self {
            wall: WallParams::default(),
            surroundings: SurroundingsParams::default(),
            motions: Vec::new(),
            tls: Some(TlsParams::default()),
            uav: None,
            seed: 1,
        }
    }
}

impl SceneParams {
    /// The same kind of survey with another wall, other surroundings, motions and noise.
    pub fn seeded(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.wall.seed = seed;
        self.surroundings.seed = seed;
        self
    }
}

/// The wall of a survey with its true motions; scenes of both epochs come from it.
pub struct World {
    /// The wall in the first epoch.
    pub wall: Wall,
    /// True motion of each stone, in the order of the wall's stones.
    pub motions: Vec<TrueMotion>,
    surface: Surface,
    props: Vec<Prop>,
    still: Vec<TrueMotion>,
}

/// Clouds of one epoch.
#[derive(Clone, Debug)]
pub struct EpochScans {
    /// From tripods.
    pub tls: Option<Scan>,
    /// From the drone.
    pub uav: Option<Scan>,
}

impl World {
    /// Builds the wall and moves its stones.
    pub fn new(params: &SceneParams) -> Self {
        let wall = Wall::new(&params.wall);
        let motions = move_stones(&wall, &params.motions, params.seed);
        let still = move_stones(&wall, &[], params.seed);
        let w = &params.wall;
        Self {
            surface: Surface::new(&wall, wall.extent()),
            props: surroundings(w.width_m, w.height_m, w.batter, &params.surroundings),
            wall,
            motions,
            still,
        }
    }

    /// The scene of an epoch: 0 before the motion, 1 after it.
    pub fn scene(&self, epoch: usize) -> Scene<'_> {
        let motions = if epoch == 0 { &self.still } else { &self.motions };
        Scene::new(&self.wall, &self.surface, motions, &self.props)
    }

    /// Scans an epoch's scene with the sensors of the parameters; noise differs between epochs and sensors.
    pub fn scan(&self, params: &SceneParams, epoch: usize) -> EpochScans {
        let scene = self.scene(epoch);
        let seed = |sensor: u64| epoch_seed(params.seed, epoch, sensor);
        EpochScans {
            tls: params.tls.as_ref().map(|p| scan_terrestrial(&scene, p, seed(0))),
            uav: params.uav.as_ref().map(|p| scan_airborne(&scene, p, seed(1))),
        }
    }
}

/// Clouds only, both epochs, with truth: fast enough for hundreds of seeds.
///
/// Cost: about a second for 4 x 3 m at 5 mm on two cores.
pub fn simulate_scans(params: &SceneParams) -> (World, [EpochScans; 2]) {
    let world = World::new(params);
    let scans = [world.scan(params, 0), world.scan(params, 1)];
    (world, scans)
}

/// Seed of one sensor in one epoch.
pub(super) fn epoch_seed(seed: u64, epoch: usize, sensor: u64) -> u64 {
    (Noise::new(seed, 1000 + 16 * epoch as u64 + sensor).uniform(0) * (1u64 << 53) as f64) as u64
}
