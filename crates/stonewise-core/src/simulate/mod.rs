//! Surveys made up from scratch, with truth: walls, motions, scanners and cameras.

mod deform;
mod drift;
mod face;
mod layout;
mod lens;
mod light;
mod material;
mod noise;
mod photo;
mod props;
mod scan;
mod scene;
mod surface;
mod survey;
mod tls;
mod truth;
mod uav;
mod wall;

pub use deform::{TrueMotion, WallMotion, move_stones, shared_displacement};
pub use face::{Face, FacePoint};
pub use lens::SensorParams;
pub use light::Light;
pub use noise::Noise;
pub use photo::{Photo, PhotoParams, Studio, disturb_views, plan_views};
pub use props::{Material, Prop, SurroundingsParams, surroundings};
pub use scan::{BeamParams, Scan};
pub use scene::{Hit, Scene, Target};
pub use surface::{HeightGrid, Surface};
pub use survey::{EpochScans, SceneParams, World, simulate_scans};
pub use tls::{TlsParams, scan_terrestrial};
pub use truth::{StoneTruth, photo_counts, point_counts, seen_share, stone_truths};
pub use uav::{UavParams, scan_airborne};
pub use wall::{SimStone, Wall, WallParams};
