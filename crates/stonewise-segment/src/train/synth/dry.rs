//! Dry stone walls: stones laid without mortar, which only their shading and the dark gaps between them tell
//! apart.

use super::draw::{Rng, between, chance, log_between, scaled, sometimes};
use super::layout::Bond;
use super::material::{FaceRelief, Mortar};
use super::stone::StoneShape;
use super::wall::Wall;

/// Median size of the stones, pixels: dry walls are mostly of small stones. Larger walls are reduced.
const STONE_PX: [f32; 2] = [18.0, 90.0];

impl Wall {
    /// Takes the mortar out of a wall: rough stones that differ little in tone, between deep, dark gaps. The
    /// stones of an arch keep their order and size; four in five other walls become rubble.
    pub(super) fn lay_dry(&mut self, rng: &mut Rng) {
        if !matches!(self.bond, Bond::Row { .. }) {
            self.stone_px = self.stone_px.min(log_between(rng, STONE_PX[0], STONE_PX[1]));
            if chance(rng, 0.8) {
                self.bond = Bond::Rubble {
                    aspect: log_between(rng, 0.9, 2.5),
                    mixture: between(rng, 0.0, 0.8),
                    disorder: between(rng, 0.3, 0.9),
                };
            }
        }

        self.shape = StoneShape {
            missing: between(rng, 0.0, 0.03),
            ..StoneShape::random(rng, true)
        };

        // Soil or nothing lies in the gaps: darker than the stone, and darker still by their depth.
        let stone = self.material.colours.first().copied().unwrap_or([0.3; 3]);
        self.mortar = Mortar {
            colour: scaled(stone, between(rng, 0.3, 0.9)),
            width: log_between(rng, 0.015, 0.14).max(0.6 / self.stone_px),
            width_spread: between(rng, 0.3, 0.9),
            recess: between(rng, 0.08, 0.4),
            smear: 0.0,
            mottle: between(rng, 0.0, 0.25),
        };
        let material = &mut self.material;
        material.tone_spread *= between(rng, 0.0, 0.7);
        material.hue_spread *= 0.5;
        let relief = &mut material.relief;

        *relief = FaceRelief {
            bulge: between(rng, 0.0, 0.2),
            roughness: between(rng, 0.003, 0.035),
            tilt: between(rng, 0.03, 0.25),
            lift: between(rng, 0.01, 0.1),
            margin: 0.0,
            tooling_px: 0.0,
            facets: sometimes(rng, 0.7, 0.1, 0.7),
            ..*relief
        };
    }
}
