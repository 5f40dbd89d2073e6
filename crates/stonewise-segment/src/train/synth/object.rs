//! Things in front of the wall that are no stones: railings, pipes, cables, windows, doors, signs, targets,
//! plants, people, ornaments, small buildings.

use super::backdrop::building_angle;
use super::draw::{Rng, between, chance, log_between, normal, scaled};
use super::material::stone_colour;
use stonewise_core::raster::linear_from_srgb;

/// Something in front of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// What it is.
    pub kind: ObjectKind,
    /// Its middle in parts of the photo's width and height.
    pub centre: [f32; 2],
    /// Half its width and height, pixels.
    pub half_px: [f32; 2],
    /// Turn in the photo, radians.
    pub angle: f32,
    /// Main and second colour, linear.
    pub colours: [[f32; 3]; 2],
    /// Height over the wall, pixels, 0 to 12: how far its shadow falls.
    pub stands_px: f32,
}

/// Kinds of things in front of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// Parallel bars with a rail across: railings, lattices, scaffolds.
    Railing,
    /// One long round bar: pipe, pole, cable.
    Pipe,
    /// A frame with panes.
    Window,
    /// A plain panel with marks like text.
    Sign,
    /// A disc of black and white sectors, or a chequered square, as surveyors use.
    Target,
    /// Leaves.
    Plant,
    /// A standing figure.
    Person,
    /// Carved rings and petals.
    Ornament,
    /// A patch of plaster over the stones.
    Patch,
    /// A moulded band.
    Cornice,
    /// A small house with smooth walls and a roof.
    Building,
}

/// From these one is drawn: railings and buildings, which stand before every dam, twice as often as the
/// others.
const KINDS: [ObjectKind; 13] = [
    ObjectKind::Railing,
    ObjectKind::Railing,
    ObjectKind::Building,
    ObjectKind::Building,
    ObjectKind::Pipe,
    ObjectKind::Window,
    ObjectKind::Sign,
    ObjectKind::Target,
    ObjectKind::Plant,
    ObjectKind::Person,
    ObjectKind::Ornament,
    ObjectKind::Patch,
    ObjectKind::Cornice,
];

impl Object {
    /// A thing drawn at random for a photo whose shorter side has `shorter` pixels, before a wall of some
    /// colour.
    pub(super) fn random(shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Self {
        let kind = KINDS[(between(rng, 0.0, KINDS.len() as f32) as usize).min(KINDS.len() - 1)];
        Self::of(kind, shorter, wall, rng)
    }

    /// Ornaments close together, as on a fountain or a portal.
    pub(super) fn carvings(shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Vec<Self> {
        let middle = [between(rng, 0.0, 1.0), between(rng, 0.0, 1.0)];
        let spread = between(rng, 0.1, 0.3);
        let base = Self::of(ObjectKind::Ornament, shorter, wall, rng);
        (0..3 + (between(rng, 0.0, 7.0) as usize))
            .map(|_| {
                let kind = if chance(rng, 0.25) {
                    ObjectKind::Cornice
                } else {
                    ObjectKind::Ornament
                };
                let own = Self::of(kind, shorter, wall, rng);
                Self {
                    centre: middle.map(|c| c + spread * normal(rng)),
                    half_px: match kind {
                        ObjectKind::Cornice => [own.half_px[0], shorter * spread],
                        _ => own.half_px,
                    },
                    colours: base.colours,
                    ..own
                }
            })
            .collect()
    }

    fn of(kind: ObjectKind, shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Self {
        let part = |low: f32, high: f32, rng: &mut Rng| shorter * log_between(rng, low, high);
        let long = 1.5 * shorter;
        let half_px = match kind {
            ObjectKind::Railing => [part(0.2, 1.5, rng), part(0.1, 0.8, rng)],
            ObjectKind::Pipe => [log_between(rng, 0.7, (0.05 * shorter).max(1.0)), long],
            ObjectKind::Cornice => [part(0.015, 0.12, rng), long],
            ObjectKind::Window => [part(0.08, 0.35, rng), part(0.08, 0.4, rng)],
            ObjectKind::Building => [part(0.1, 0.6, rng), part(0.15, 0.7, rng)],
            ObjectKind::Sign => [part(0.02, 0.15, rng), part(0.02, 0.15, rng)],
            ObjectKind::Target => [part(0.015, 0.07, rng); 2],
            ObjectKind::Plant | ObjectKind::Patch => [part(0.05, 0.35, rng), part(0.05, 0.35, rng)],
            ObjectKind::Person => {
                let height = part(0.1, 0.5, rng);
                [0.28 * height, height]
            }
            ObjectKind::Ornament => {
                let radius = part(0.05, 0.3, rng);
                [radius, radius * between(rng, 0.6, 1.4)]
            }
        };

        let any = |rng: &mut Rng| {
            let grey = between(rng, 0.05, 0.9);
            [0, 1, 2].map(|_| linear_from_srgb((grey * (0.35 * normal(rng)).exp()).clamp(0.02, 0.95)))
        };
        let metal = |rng: &mut Rng| [linear_from_srgb(between(rng, 0.1, 0.75)); 3];
        let colours = match kind {
            ObjectKind::Railing | ObjectKind::Pipe => {
                let colour = if chance(rng, 0.7) { metal(rng) } else { any(rng) };
                [colour, colour]
            }
            ObjectKind::Plant => [[0.26, 0.34, 0.13], [0.38, 0.42, 0.22]]
                .map(|base| base.map(|c| linear_from_srgb(c) * (0.25 * normal(rng)).exp())),
            ObjectKind::Target => [[0.9; 3], [0.02; 3]],
            ObjectKind::Ornament | ObjectKind::Cornice | ObjectKind::Patch => {
                let colour = if chance(rng, 0.6) {
                    scaled(wall, (0.2 * normal(rng)).exp())
                } else {
                    stone_colour(rng)
                };
                [colour, scaled(colour, 0.7)]
            }
            _ => [any(rng), any(rng)],
        };

        Self {
            kind,
            centre: [between(rng, 0.0, 1.0), between(rng, 0.0, 1.0)],
            half_px,
            angle: match kind {
                ObjectKind::Pipe | ObjectKind::Cornice => building_angle(rng),
                _ => 0.1 * normal(rng),
            },
            colours,
            stands_px: match kind {
                ObjectKind::Railing | ObjectKind::Plant | ObjectKind::Person | ObjectKind::Building => {
                    between(rng, 2.0, 12.0)
                }
                ObjectKind::Window => -between(rng, 0.0, 6.0),
                _ => between(rng, 0.3, 4.0),
            },
        }
    }
}
