//! Remarks of readers of camera files, and why edits have no effect.

use super::Said;
use super::message::{Message, messages};
use stonewise_core::transfer::NoEffect;
use stonewise_io::cameras::Remark;

messages! {
    REMARKS {
        NOT_ALIGNED,
        DISABLED,
        SMALLER_RECONSTRUCTION,
        SEVERAL_RECONSTRUCTIONS,
        LARGEST_MODEL,
        CHUNK_DISABLED,
        CHUNK_NOT_READ,
        ROLLING_SHUTTER,
        YAW_FROM_TRUE_NORTH,
        NO_STONE,
        ONE_STONE,
        NOT_CROSSED,
        SMALL_PART,
        FEW_POINTS,
        NOTHING_INSIDE,
    }
}

impl From<&Remark> for Said {
    fn from(remark: &Remark) -> Self {
        match remark {
            Remark::NotAligned => (&NOT_ALIGNED).into(),
            Remark::Disabled => (&DISABLED).into(),
            Remark::SmallerReconstruction => (&SMALLER_RECONSTRUCTION).into(),
            Remark::SeveralReconstructions(n) => SEVERAL_RECONSTRUCTIONS.say(&[("n", n.to_string().into())]),
            Remark::LargestModel {
                read: (read, photos),
                others,
            } => {
                let others: Vec<String> = others.iter().map(|(place, n)| format!("{place} ({n})")).collect();
                LARGEST_MODEL.say(&[
                    ("read", read.as_str().into()),
                    ("photos", photos.to_string().into()),
                    ("others", others.join(", ").into()),
                ])
            }
            Remark::ChunkDisabled(chunk) => CHUNK_DISABLED.say(&[("chunk", chunk.as_str().into())]),
            Remark::ChunkNotRead { chunk, used } => {
                CHUNK_NOT_READ.say(&[("chunk", chunk.as_str().into()), ("used", used.as_str().into())])
            }
            Remark::RollingShutter => (&ROLLING_SHUTTER).into(),
            Remark::YawFromTrueNorth => (&YAW_FROM_TRUE_NORTH).into(),
            Remark::RigSlave | Remark::NotPlaced(_) => remark.to_string().into(),
        }
    }
}

impl From<&NoEffect> for Said {
    fn from(reason: &NoEffect) -> Self {
        let counts = |points: &u64, needed: &u32| {
            [
                ("points", points.to_string().into()),
                ("needed", needed.to_string().into()),
            ]
        };
        match reason {
            NoEffect::NoStone { at } => {
                let place = Self::list(&[at.x, at.y].map(|m| format!("{m:.2}")));
                NO_STONE.say(&[("place", place)])
            }
            NoEffect::OneStone { stone } => ONE_STONE.say(&[("stone", stone.to_string().into())]),
            NoEffect::NotCrossed => (&NOT_CROSSED).into(),
            NoEffect::SmallPart {
                stone,
                points,
                needed,
            } => {
                let [points, needed] = counts(points, needed);
                SMALL_PART.say(&[("stone", stone.to_string().into()), points, needed])
            }
            NoEffect::FewPoints { points, needed } => FEW_POINTS.say(&counts(points, needed)),
            NoEffect::NothingInside => (&NOTHING_INSIDE).into(),
            NoEffect::NoPlace(reason) => reason.as_str().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Libraries below this one say the same in English.
    #[test]
    fn english_is_what_the_libraries_print() {
        let name = || "a".to_owned();
        let remarks = [
            Remark::NotAligned,
            Remark::Disabled,
            Remark::RigSlave,
            Remark::SmallerReconstruction,
            Remark::SeveralReconstructions(2),
            Remark::ChunkDisabled(name()),
            Remark::ChunkNotRead {
                chunk: name(),
                used: "b".to_owned(),
            },
            Remark::YawFromTrueNorth,
            Remark::RollingShutter,
        ];
        for remark in &remarks {
            assert_eq!(Said::from(remark).english, remark.to_string());
        }
        let reasons = [
            NoEffect::NoStone {
                at: [1.0, -2.5].into(),
            },
            NoEffect::OneStone { stone: 3 },
            NoEffect::NotCrossed,
            NoEffect::SmallPart {
                stone: 3,
                points: 7,
                needed: 50,
            },
            NoEffect::FewPoints {
                points: 7,
                needed: 50,
            },
            NoEffect::NothingInside,
            NoEffect::NoPlace(name()),
        ];
        for reason in &reasons {
            assert_eq!(Said::from(reason).english, reason.to_string());
        }
        let place = Said::from(&reasons[0]);
        assert_eq!(
            place.text(crate::report_params::Language::German),
            "kein Stein bei (1,00; -2,50) m"
        );
    }
}
