//! A whole simulated survey in memory: the wall, what it did, and the clouds of both epochs.

use crate::world::deform::{TrueMotion, WallMotion, move_stones};
use crate::world::noise::Noise;
use crate::world::props::{Prop, SurroundingsParams, surroundings};
use crate::world::scan::Scan;
use crate::world::scene::Scene;
use crate::world::surface::{SampledFaces, Surface};
use crate::world::tls::{TlsParams, scan_terrestrial};
use crate::world::uav::{UavParams, scan_airborne};
use crate::world::wall::Wall;
use crate::world::wall_params::WallParams;
use crate::world::window::Window;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

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
    /// Sets the seeds of the wall, of its surroundings, and of the motions and measurements.
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
    whole: OnceLock<Surface>,
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
    /// Builds the wall and moves its stones. Surfaces are sampled when they are first used.
    pub fn new(params: &SceneParams) -> Self {
        let wall = Wall::new(&params.wall);
        let motions = move_stones(&wall, &params.motions, params.seed);
        let still = move_stones(&wall, &[], params.seed);
        Self {
            props: surroundings(&wall, &params.surroundings),
            whole: OnceLock::new(),
            wall,
            motions,
            still,
        }
    }

    /// The scene of an epoch: 0 before the motion, 1 after it. The whole section, which a large dam is too
    /// large for.
    pub fn scene(&self, epoch: usize) -> Scene<'_> {
        let whole = self.whole.get_or_init(|| self.surface(self.wall.extent()));
        self.scene_of(whole, epoch)
    }

    /// The scene of a part of the section whose surface was sampled with [`World::surface`].
    pub fn scene_of<'a>(&'a self, surface: &'a Surface, epoch: usize) -> Scene<'a> {
        let motions = if epoch == 0 { &self.still } else { &self.motions };
        Scene::new(&self.wall, surface, motions, &self.props)
    }

    /// Samples the surface of a part of the section: smallest a, largest a, smallest u, largest u, metres.
    pub fn surface(&self, part: [f64; 4]) -> Surface {
        self.next_surface(part, &mut SampledFaces::default())
    }

    /// Samples the surface of a part of the section, as [`World::surface`] does, where parts that overlap are sampled
    /// one after the other: `sampled` holds the faces of the part before.
    pub fn next_surface(&self, part: [f64; 4], sampled: &mut SampledFaces) -> Surface {
        Surface::new(&self.wall, part, sampled)
    }

    /// Scans an epoch's scene with the sensors of the parameters; noise differs between epochs and sensors.
    pub fn scan(&self, params: &SceneParams, epoch: usize) -> EpochScans {
        let (scene, whole) = (self.scene(epoch), Window::whole());
        EpochScans {
            tls: scan_window(&scene, params, Sensor::Tls, epoch, &whole),
            uav: scan_window(&scene, params, Sensor::Uav, epoch, &whole),
        }
    }
}

/// Which scanner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// On tripods.
    Tls,
    /// Under a drone.
    Uav,
}

impl Sensor {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Tls, Self::Uav];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tls => "tls",
            Self::Uav => "uav",
        }
    }
}

/// What one scanner measures of a piece of the section; `None` where the survey has no such scanner.
///
/// `scene`: of the piece's [`Window::surroundings`] at least. The points of all pieces together are the
/// cloud.
pub fn scan_window(
    scene: &Scene,
    params: &SceneParams,
    sensor: Sensor,
    epoch: usize,
    window: &Window,
) -> Option<Scan> {
    let seed = epoch_seed(params.seed, epoch, sensor as u64);
    let mut scan = match sensor {
        Sensor::Tls => scan_terrestrial(scene, window, params.tls.as_ref()?, seed),
        Sensor::Uav => scan_airborne(scene, window, params.uav.as_ref()?, seed),
    };
    scan.start_at(FIRST_SCAN_S + YEAR_S * epoch as f64 + FLIGHT_AFTER_S * f64::from(sensor as u8));
    Some(scan)
}

/// When the first epoch's first scan begins: 2025-04-14 08:00 UTC in adjusted standard GPS time, seconds.
const FIRST_SCAN_S: f64 = 428_652_818.0;
/// From one epoch to the next, seconds.
const YEAR_S: f64 = 365.0 * 86_400.0;
/// The drone flies four hours after the terrestrial scans begin, seconds.
const FLIGHT_AFTER_S: f64 = 4.0 * 3600.0;

/// Seed of one sensor in one epoch.
pub(super) fn epoch_seed(seed: u64, epoch: usize, sensor: u64) -> u64 {
    (Noise::new(seed, 1000 + 16 * epoch as u64 + sensor).uniform(0) * (1u64 << 53) as f64) as u64
}
