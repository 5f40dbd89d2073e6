//! Small buildings that stand before a wall: smooth faces with a roof, a door or a window, and a base.

use super::draw::{Rng, between, chance, scaled, sometimes};

/// What is drawn once for a building; places in parts of half its width and height, y down.
pub(super) struct Facade {
    /// Where the roof ends and the front begins, -0.9 to -0.3.
    eaves: f32,
    /// Half the front's width, 0.75 to 1: the roof overhangs it.
    half_front: f32,
    /// How much narrower the ridge is than the eaves, 0 to 0.5.
    hip: f32,
    /// Left of this is the front, right of it a side in other light.
    corner: f32,
    /// Light on the side over that on the front, 0.3 to 1.2.
    side_tone: f32,
    /// Doors and windows: x from, y from, x to, y to.
    openings: Vec<[f32; 4]>,
    /// Brightness of the base, and where it begins; 1 without a base.
    base: [f32; 2],
}

impl Facade {
    pub(super) fn random(rng: &mut Rng) -> Self {
        let eaves = between(rng, -0.9, -0.3);
        let count = (0..3).filter(|_| chance(rng, 0.5)).count();
        let openings = (0..count)
            .map(|_| {
                let (x, y) = (between(rng, -0.7, 0.4), between(rng, eaves + 0.1, 0.5));
                let is_door = chance(rng, 0.5);
                let bottom = if is_door { 1.0 } else { y + between(rng, 0.15, 0.5) };
                [x, y, x + between(rng, 0.15, 0.5), bottom]
            })
            .collect();
        Self {
            eaves,
            half_front: between(rng, 0.75, 1.0),
            hip: sometimes(rng, 0.6, 0.05, 0.5),
            corner: if chance(rng, 0.6) {
                between(rng, -0.3, 0.9)
            } else {
                1.0
            },
            side_tone: between(rng, 0.3, 1.2),
            openings,
            base: [between(rng, 0.5, 1.2), sometimes(rng, 0.4, -0.3, 0.0) + 1.0],
        }
    }

    /// Colour at a place, from those of front and roof; `None` beside the building.
    pub(super) fn at(&self, x: f32, y: f32, front: [f32; 3], roof: [f32; 3]) -> Option<[f32; 3]> {
        if !(-1.0..1.0).contains(&y) {
            return None;
        }
        let side = if x > self.corner { self.side_tone } else { 1.0 };
        if y < self.eaves {
            let up = (self.eaves - y) / (self.eaves + 1.0);
            return (x.abs() < 1.0 - self.hip * up).then(|| scaled(roof, side));
        }
        if x.abs() > self.half_front {
            return None;
        }
        let is_open = |o: &[f32; 4]| (o[0]..o[2]).contains(&x) && (o[1]..o[3]).contains(&y);
        if self.openings.iter().any(is_open) {
            return Some([0.02, 0.021, 0.024]);
        }
        // The roof keeps the light from the top of the front.
        let shade = if y < self.eaves + 0.12 { 0.45 } else { 1.0 };
        let base = if y > self.base[1] { self.base[0] } else { 1.0 };
        Some(scaled(front, side * shade * base))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_building_has_a_roof_a_front_a_side_and_a_door() {
        let facade = Facade {
            eaves: -0.5,
            half_front: 0.8,
            hip: 0.4,
            corner: 0.3,
            side_tone: 0.5,
            openings: vec![[-0.6, 0.2, -0.2, 1.0]],
            base: [0.7, 0.9],
        };
        let (front, roof) = ([0.8; 3], [0.4, 0.2, 0.1]);
        let at = |x: f32, y: f32| facade.at(x, y, front, roof);
        // Half-way up the roof a fifth of its half width is gone.
        assert_eq!(at(0.1, -0.75), Some(roof));
        assert_eq!((at(-0.79, -0.75), at(-0.81, -0.75)), (Some(roof), None));
        assert_eq!((at(-0.79, 0.0), at(-0.81, 0.0)), (Some(front), None));
        assert_eq!(
            at(0.5, 0.0),
            Some([0.4; 3]),
            "the side has half the front's light"
        );
        assert!(at(-0.4, 0.5).is_some_and(|door| door[0] < 0.1));
        assert_eq!(at(0.0, 0.95), Some([0.8 * 0.7; 3]), "the base");
        assert_eq!((at(0.0, -1.1), at(0.0, 1.0)), (None, None));
    }
}
