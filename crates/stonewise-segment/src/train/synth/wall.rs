//! A wall of one kind of masonry: how its stones are laid, and what they are made of.

use super::cell::Extent;
use super::draw::{Rng, between, chance, log_between};
use super::layout::Bond;
use super::material::{Material, Mortar};
use super::stone::{Stone, StoneShape};

/// A wall of one kind of masonry.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// How the stones are laid.
    pub bond: Bond,
    /// Square root of a stone's area, about the median, 10 to 320 pixels in the middle of the photo.
    pub stone_px: f32,
    /// How stones depart from their cells.
    pub shape: StoneShape,
    /// What the stones are made of.
    pub material: Material,
    /// What lies between them.
    pub mortar: Mortar,
}

impl Wall {
    /// A wall drawn at random, its stones between `smallest` and `largest` pixels at the median.
    pub(super) fn random(rng: &mut Rng, smallest: f32, largest: f32) -> Self {
        let bond = Bond::random(rng);
        let stone_px = log_between(rng, smallest, largest);
        let mut material = Material::random(rng);
        let mut mortar = Mortar::random(rng, &material, stone_px);
        make_visible(&mut material, &mut mortar, stone_px, rng);
        Self {
            bond,
            stone_px,
            shape: StoneShape::random(rng, matches!(bond, Bond::Rubble { .. })),
            material,
            mortar,
        }
    }

    /// The extent with a margin and the layout's origin anywhere.
    pub(super) fn roomy(&self, extent: Extent, rng: &mut Rng) -> Extent {
        let margin = 1.5 * self.stone_px;
        let mut shift = || margin + between(rng, 0.0, self.stone_px);
        [
            extent[0] - shift(),
            extent[1] - shift(),
            extent[2] + margin,
            extent[3] + margin,
        ]
    }

    /// The stones of an extent.
    pub(super) fn stones(&self, extent: Extent, rng: &mut Rng) -> Vec<Stone> {
        self.bond
            .lay(self.stone_px, extent, rng)
            .iter()
            .filter_map(|ring| Stone::new(ring, &self.shape, rng))
            .collect()
    }
}

/// Leaves at least one sign by which a person could tell stones apart: the joints' colour, their depth, or
/// the stones' tones.
fn make_visible(material: &mut Material, mortar: &mut Mortar, stone_px: f32, rng: &mut Rng) {
    let brightness = |c: [f32; 3]| c[0] + c[1] + c[2];
    let stone = material.colours.first().map_or(1.0, |&c| brightness(c));
    let contrast = (brightness(mortar.colour) / stone.max(1e-3)).ln().abs();
    let width_px = mortar.width * stone_px;
    let rough_px = material.relief.roughness * stone_px;
    let by_colour = contrast * width_px.min(1.5) > 0.2 + 0.5 * material.mottle + 0.2 * material.accent;
    let by_depth = mortar.recess * stone_px > 0.8 + rough_px;
    let by_tone = material.tone_spread > 0.12 + 0.5 * material.mottle;
    if by_colour || by_depth || by_tone {
        return;
    }
    if chance(rng, 0.6) {
        mortar.width = mortar.width.max((0.7 + 0.5 * rough_px) / stone_px);
        mortar.recess = (between(rng, 0.8, 2.5) + rough_px) / stone_px;
    } else {
        material.tone_spread = between(rng, 0.13, 0.3);
        material.mottle *= 0.3;
    }
}
