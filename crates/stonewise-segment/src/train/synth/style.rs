//! Everything that is chosen at random for a photo.

use super::camera::Camera;
use super::dirt::Dirt;
use super::draw::{chance, stream};
use super::light::Light;
use super::object::Object;
use super::scene::{Layer, random_layers};
use super::view::Viewpoint;
use std::f32::consts::FRAC_PI_2;

/// Largest number of single objects in front of a wall; carvings come on top.
const MAX_OBJECTS: usize = 4;

/// Everything that is chosen at random for a photo except the single stones and the noise.
#[derive(Clone, Debug, PartialEq)]
pub struct MasonryStyle {
    /// What is where, from back to front.
    pub layers: Vec<Layer>,
    /// What lies on the surfaces.
    pub dirt: Dirt,
    /// Things in front, from back to front.
    pub objects: Vec<Object>,
    /// The light.
    pub light: Light,
    /// What camera and file format do.
    pub camera: Camera,
}

impl MasonryStyle {
    /// A style for a photo of `width` x `height` pixels.
    pub fn random(seed: u64, width: u32, height: u32) -> Self {
        Self::drawn(seed, width, height, false)
    }

    /// A random style, as [`Self::random`] draws it, with the walls laid dry: mostly small rubble without mortar,
    /// between dark, deep gaps.
    pub fn dry(seed: u64, width: u32, height: u32) -> Self {
        Self::drawn(seed, width, height, true)
    }

    fn drawn(seed: u64, width: u32, height: u32, is_dry: bool) -> Self {
        // A stream apart from that of the single stones.
        let mut rng = stream(seed, 1);
        let viewpoint = Viewpoint::random(&mut rng);
        let mut layers = random_layers(viewpoint, width, height, &mut rng);
        if is_dry {
            let mut rng = stream(seed, 3);
            for layer in &mut layers {
                layer.lay_dry(&mut rng);
            }
        }
        let shorter = width.min(height) as f32;
        let smallest_px = layers.iter().map(Layer::stone_px).fold(shorter, f32::min);
        let often = if chance(&mut rng, 0.45) { 0.45 } else { 0.08 };
        let count = (0..MAX_OBJECTS).filter(|_| chance(&mut rng, often)).count();
        let colour = layers.first().map_or([0.3; 3], Layer::colour);
        let mut objects = if chance(&mut rng, 0.06) {
            Object::carvings(shorter, colour, &mut rng)
        } else {
            Vec::new()
        };
        objects.extend((0..count).map(|_| Object::random(shorter, colour, &mut rng)));
        Self {
            layers,
            dirt: Dirt::random(&mut rng, FRAC_PI_2 + viewpoint.roll),
            objects,
            light: Light::random(&mut rng),
            camera: Camera::random(smallest_px, &mut rng),
        }
    }
}
