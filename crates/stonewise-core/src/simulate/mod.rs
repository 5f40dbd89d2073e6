//! Surveys made up from scratch, with truth: walls, motions, scanners and cameras.

mod deform;
mod face;
mod layout;
mod noise;
mod props;
mod scan;
mod scene;
mod surface;
mod survey;
mod tls;
mod uav;
mod wall;

pub use deform::{TrueMotion, WallMotion, move_stones, shared_displacement};
pub use face::{Face, FacePoint};
pub use noise::Noise;
pub use props::{Material, Prop, SurroundingsParams, surroundings};
pub use scan::{BeamParams, Scan};
pub use scene::{Hit, Scene, Target};
pub use surface::{HeightGrid, Surface};
pub use survey::{EpochScans, SceneParams, World, simulate_scans};
pub use tls::{TlsParams, scan_terrestrial};
pub use uav::{UavParams, scan_airborne};
pub use wall::{SimStone, Wall, WallParams};
