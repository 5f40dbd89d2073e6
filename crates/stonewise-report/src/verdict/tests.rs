//! Made-up walls whose true motion is known.

use super::assess::assess;
use super::case::{Case, JointCase, StoneCase, StoneMeasured};
use super::interval::Estimate;
use super::testing::Normal;
use crate::texts::Texts;
use nalgebra::{Matrix3, Point2, Vector3};
use stonewise_base::report_params::Language;
use stonewise_base::thresholds::{Quantity, Thresholds};
use stonewise_core::registration::{Against, ZoneKind};
use stonewise_core::statistics::q_values;
use stonewise_results::detection_limit_m;
use stonewise_results::records::{
    DatumState, DeformationVerdict, DeformedZone, EpochVerdict, ReasonCode, State,
};

const SD_M: f64 = 0.0005;

pub(super) fn thresholds(text: &str) -> Thresholds {
    toml::from_str(text).unwrap()
}

/// 5 and 10 mm.
fn usual() -> Thresholds {
    thresholds("attention_mm = 5.0\nalarm_mm = 10.0")
}

/// A stone at (along, up) that truly moved so, measured with an error of `SD_M` per axis.
pub(super) fn stone(stone_id: u32, place: [f64; 2], moved: Vector3<f64>, normal: &mut Normal) -> StoneCase {
    let covariance = Matrix3::identity() * SD_M * SD_M;
    let vector = moved + normal.vector() * SD_M;
    let detection_limit_m = detection_limit_m(&vector, &covariance);
    StoneCase {
        stone_id,
        place: Point2::from(place),
        lost: false,
        is_masonry: true,
        rate: None,
        departure: None,
        measured: Some(StoneMeasured {
            motion: Estimate { vector, covariance },
            neighbours: Estimate { vector, covariance },
            above_limit: vector.norm() > detection_limit_m,
            loose: false,
            shape_tested: false,
            detection_limit_m,
        }),
    }
}

/// A wall of 100 stones of which the first `moving` truly moved by `length_m`; the datum is known.
pub(super) fn wall(moving: u32, length_m: f64, seed: u64) -> Case {
    let mut normal = Normal::new(seed);
    let stones = (0..100).map(|i| {
        let moved = Vector3::z() * if i < moving { length_m } else { 0.0 };
        stone(i + 1, [f64::from(i % 10), f64::from(i / 10)], moved, &mut normal)
    });
    Case {
        epochs: ["A".to_owned(), "B".to_owned()],
        datum: Some(DatumState::Stable),
        stones: stones.collect(),
        ..Case::default()
    }
}

pub(super) fn judge(case: &Case, thresholds: &Thresholds) -> EpochVerdict {
    assess(case, thresholds, Texts::of(Language::English))
}

pub(super) fn codes(verdict: &EpochVerdict) -> Vec<ReasonCode> {
    verdict.reasons.iter().map(|r| r.code).collect()
}

#[test]
fn still_walls_are_fine_and_never_alarm() {
    let mut shown = 0;
    for seed in 0..100 {
        let case = wall(0, 0.0, seed);
        let verdict = judge(&case, &usual());
        assert_eq!(verdict.state, State::Fine, "{}", verdict.sentence);
        assert!(
            verdict.sentence.starts_with(
                "Fine: none of the 100 measured stones reaches the attention threshold of 5 mm; detection"
            ),
            "{}",
            verdict.sentence
        );
        // Without thresholds motion is shown on a still wall in at most 5 % of the surveys.
        let verdict = judge(&case, &Thresholds::default());
        assert_ne!(verdict.state, State::Alarm);
        shown += usize::from(verdict.state == State::Attention);
    }
    // 5 of 100, with three standard deviations.
    assert!(shown <= 11, "{shown}");
}

#[test]
fn a_known_motion_beyond_a_threshold_is_an_alarm_or_calls_for_attention() {
    for (length_m, state) in [
        (0.015, State::Alarm),
        (0.0075, State::Attention),
        (0.0051, State::CannotTell),
        (0.002, State::Fine),
    ] {
        let verdict = judge(&wall(1, length_m, 3), &usual());
        assert_eq!(verdict.state, state, "{length_m}: {}", verdict.sentence);
        assert!(verdict.stones[0].moved && verdict.stones[0].state == state);
        assert!(verdict.wall.moved <= 2 && verdict.wall.largest.unwrap().stone_id == 1);
    }
    let verdict = judge(&wall(3, 0.015, 4), &usual());
    assert!(
        verdict.sentence.starts_with(
            "Alarm: 3 stones moved beyond the alarm threshold of 10 mm; the largest motion is 1"
        ),
        "{}",
        verdict.sentence
    );
    let verdict = judge(&wall(3, 0.015, 4), &Thresholds::default());
    assert_eq!(
        (verdict.state, codes(&verdict)),
        (State::Attention, vec![ReasonCode::MotionShown])
    );
}

#[test]
fn a_run_in_doubt_cannot_tell_whatever_it_shows() {
    for (moving, thresholds) in [(0, usual()), (5, usual()), (5, Thresholds::default())] {
        let mut case = wall(moving, 0.03, 5);
        case.in_doubt = true;
        let verdict = judge(&case, &thresholds);
        assert_eq!(verdict.state, State::CannotTell);
        assert_eq!(codes(&verdict)[0], ReasonCode::InDoubt);
        assert!(
            verdict
                .stones
                .iter()
                .all(|s| s.state == State::CannotTell && !s.moved && !s.loose)
        );
        assert_eq!((verdict.wall.moved, verdict.wall.largest), (0, None));
        case.not_converged = true;
        let verdict = judge(&case, &thresholds);
        assert!(
            verdict
                .sentence
                .starts_with("Cannot tell: the adjustment did not converge")
        );
        let apparent = moving > 0 && !thresholds.is_empty();
        assert_eq!(
            verdict.sentence.contains("as computed, 5 stones"),
            apparent,
            "{}",
            verdict.sentence
        );
    }
}

#[test]
fn without_a_datum_nothing_is_fine_but_a_motion_against_the_rest_is_an_alarm() {
    let mut case = wall(0, 0.0, 6);
    case.datum = Some(DatumState::Unknown);
    for thresholds in [usual(), Thresholds::default()] {
        let verdict = judge(&case, &thresholds);
        assert_eq!(verdict.state, State::CannotTell);
        assert_eq!(codes(&verdict), [ReasonCode::DatumUnknown]);
        assert!(
            verdict
                .sentence
                .contains("no stone moved against the common motion of the wall; detection limit against the common motion: "),
            "{}",
            verdict.sentence
        );
    }

    let mut moving = wall(1, 0.02, 6);
    moving.datum = Some(DatumState::Unknown);
    let sentence = judge(&moving, &Thresholds::default()).sentence;
    assert!(
        sentence.contains(
            " measured stones moved against the common motion of the wall; the largest of these motions is "
        ),
        "{sentence}"
    );

    // Only motions against neighbours are asked for: a common motion does not matter.
    let neighbours = thresholds("neighbours = { attention_mm = 3.0, alarm_mm = 6.0 }");
    assert_eq!(judge(&case, &neighbours).state, State::Fine);
    let mut case = wall(1, 0.02, 6);
    case.datum = Some(DatumState::Unknown);
    case.stones[0].measured.as_mut().unwrap().loose = true;

    for thresholds in [usual(), neighbours] {
        let verdict = judge(&case, &thresholds);
        assert_eq!(verdict.state, State::Alarm, "{}", verdict.sentence);
        assert!(
            verdict
                .sentence
                .contains("against the common motion of the wall is")
        );
        let whole = "; the registration error between the surveys is unknown, so a motion of the wall as a whole would not show.";
        assert_eq!(
            verdict.sentence.ends_with(whole),
            thresholds.of(Quantity::Length, None).next().is_some(),
            "{}",
            verdict.sentence
        );
    }
}

#[test]
fn without_a_datum_a_stone_moved_only_if_it_is_loose_or_the_wall_changed_its_shape() {
    for (shape_tested, is_loose, is_bulged, moved) in [
        (false, false, false, true),
        (true, false, false, false),
        (true, true, false, true),
        (true, false, true, true),
    ] {
        for datum in [DatumState::Unknown, DatumState::Stable] {
            let mut case = wall(1, 0.02, 6);
            case.datum = Some(datum);
            case.deformation = bulged(is_bulged).deformation;
            let measured = case.stones[0].measured.as_mut().unwrap();
            (measured.shape_tested, measured.loose) = (shape_tested, is_loose);
            let verdict = judge(&case, &usual());
            let expected = moved || datum == DatumState::Stable;
            assert_eq!(
                verdict.stones[0].moved, expected,
                "{shape_tested} {is_loose} {is_bulged}"
            );
            let state = if expected { State::Alarm } else { State::CannotTell };
            assert_eq!(verdict.stones[0].state, state);
        }
    }
}

#[test]
fn lost_stones_call_for_attention() {
    for thresholds in [usual(), Thresholds::default()] {
        let mut case = wall(0, 0.0, 7);
        (case.stones[4].lost, case.stones[4].measured) = (true, None);
        let verdict = judge(&case, &thresholds);
        assert_eq!((verdict.state, verdict.wall.lost), (State::Attention, 1));
        assert!(
            verdict.sentence.starts_with("Attention: 1 stone is lost"),
            "{}",
            verdict.sentence
        );
        assert_eq!(verdict.stones[4].state, State::Attention);
    }
}

#[test]
fn a_run_that_measured_little_or_nothing_cannot_tell() {
    let mut case = wall(0, 0.0, 8);
    for stone in &mut case.stones[..60] {
        stone.measured = None;
    }
    let verdict = judge(&case, &usual());
    assert_eq!(codes(&verdict), [ReasonCode::FewMeasured]);
    assert!(
        verdict
            .sentence
            .starts_with("Cannot tell: only 40 of 100 stones were measured")
    );
    case.stones.iter_mut().for_each(|s| s.measured = None);
    assert_eq!(codes(&judge(&case, &usual())), [ReasonCode::NothingMeasured]);
    assert_eq!(judge(&Case::default(), &usual()).state, State::CannotTell);
    // Limits of 8 mm cannot show motions of 5 mm.
    let mut case = wall(0, 0.0, 8);
    for stone in &mut case.stones {
        stone.measured.as_mut().unwrap().motion.covariance *= 36.0;
    }
    assert_eq!(
        codes(&judge(&case, &usual())),
        [ReasonCode::IntervalReachesThreshold]
    );
}

#[test]
fn zones_are_judged_by_their_own_thresholds() {
    let zone = "attention_mm = 20.0\nalarm_mm = 40.0\n[[zones]]\nname = \"crest\"\npolygon = [[-0.5, -0.5], [9.5, -0.5], [9.5, 0.5], \
        [-0.5, 0.5]]\nattention_mm = 3.0\nalarm_mm = 4.0\n[[zones]]\nname = \"empty\"\npolygon = [[50.0, 0.0], [51.0, 0.0], [51.0, 1.0]]\n";
    let verdict = judge(&wall(2, 0.006, 9), &thresholds(zone));
    assert_eq!(
        (verdict.state, verdict.zones[0].area.state),
        (State::Alarm, State::Alarm)
    );
    assert_eq!(
        (verdict.zones[0].area.stones, verdict.zones[0].area.moved),
        (10, 2)
    );
    assert_eq!(verdict.zones[1].area.reasons, [ReasonCode::NothingMeasured]);
    assert!(
        verdict
            .sentence
            .contains("2 stones moved beyond the alarm threshold of 4 mm (crest)")
    );

    assert_eq!(verdict.stones[0].zone.as_deref(), Some("crest"));
    assert_eq!(
        (verdict.stones[10].zone.clone(), verdict.stones[10].state),
        (None, State::Fine)
    );

    // The crest did not move, the rest did by less than its own threshold.
    let mut case = wall(0, 0.0, 9);
    case.stones[50] = stone(51, [0.0, 5.0], Vector3::x() * 0.006, &mut Normal::new(1));
    let verdict = judge(&case, &thresholds(zone));
    assert_eq!(verdict.state, State::Fine);
    assert!(
        verdict
            .sentence
            .contains("of 3 mm (crest) or 20 mm (rest of the wall)"),
        "{}",
        verdict.sentence
    );
}

#[test]
fn an_opening_joint_is_judged_and_a_closing_one_is_not() {
    let joints = thresholds("attention_mm = 50.0\njoints = { attention_mm = 2.0, alarm_mm = 4.0 }");
    for (opening_m, state) in [
        (0.006, State::Alarm),
        (0.003, State::Attention),
        (0.0005, State::Fine),
        (0.0018, State::CannotTell),
        (-0.006, State::Fine),
    ] {
        let mut case = wall(0, 0.0, 10);
        case.joints.push(JointCase {
            stones: [1, 2],
            place: Point2::new(0.5, 0.0),
            opening_m,
            sigma_m: 0.0003,
        });
        let verdict = judge(&case, &joints);
        assert_eq!(verdict.state, state, "{opening_m}: {}", verdict.sentence);
        assert_eq!(
            verdict.joints.len(),
            usize::from(opening_m > 0.001),
            "{opening_m}"
        );
    }
}

#[test]
fn at_most_five_percent_of_the_stones_said_to_have_moved_stood_still() {
    let (mut said, mut wrongly) = (0, 0.0);
    for seed in 0..200 {
        let verdict = judge(&wall(20, 0.0022, 1000 + seed), &usual());
        let moved: Vec<bool> = verdict.stones.iter().map(|s| s.moved).collect();
        let all = moved.iter().filter(|m| **m).count();
        wrongly += moved[20..].iter().filter(|m| **m).count() as f64 / all.max(1) as f64;
        said += all;
    }
    // 5 % of the four fifths that stand still, with four standard errors.
    assert!(wrongly / 200.0 < 0.04 + 0.017, "{}", wrongly / 200.0);
    assert!(said > 200 * 10, "{said}");
}

#[test]
fn the_sentence_speaks_german_too() {
    let verdict = assess(&wall(3, 0.015, 4), &usual(), Texts::of(Language::German));
    assert!(
        verdict.sentence.starts_with("Alarm: 3 Steine haben sich \u{fc}ber die Alarmschwelle von 10 mm hinaus bewegt; die gr\u{f6}\u{df}te Bewegung betr\u{e4}gt 1"),
        "{}",
        verdict.sentence
    );
    assert!(verdict.sentence.contains(','), "{}", verdict.sentence);
}

#[test]
fn at_most_five_percent_of_the_stones_said_to_move_stand_still() {
    let (mut normal, mut shares) = (Normal::new(9), Vec::new());
    for _ in 0..300 {
        // A tenth of 200 stones moves by four standard deviations.
        let p: Vec<f64> = (0..200)
            .map(|i| {
                let moved = Vector3::x() * if i < 20 { 4.0 } else { 0.0 };
                Estimate {
                    vector: moved + normal.vector(),
                    covariance: Matrix3::identity(),
                }
                .p_value()
            })
            .collect();
        let found: Vec<usize> = (0..200)
            .zip(q_values(&p))
            .filter(|(_, q)| *q <= 0.05)
            .map(|(i, _)| i)
            .collect();
        let false_ones = found.iter().filter(|i| **i >= 20).count();
        shares.push(false_ones as f64 / found.len().max(1) as f64);
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    // 5 % times the share that stands still, with four standard errors of 300 walls.
    assert!(mean < 0.045 + 0.015, "{mean}");
    assert!(mean > 0.02, "{mean}: nothing was tested");
}

/// A still wall with a zone that bulged by 1.9 mm (1.7 to 2.1), or none.
pub(super) fn bulged(is_bulged: bool) -> Case {
    let zone = DeformedZone {
        zone_id: 1,
        state: State::default(),
        decided_by: None,
        kind: ZoneKind::Bulge,
        along_m: 4.0,
        up_m: 2.0,
        against: Against::RestOfWall,
        diameter_m: None,
        length_m: 2.13,
        width_m: 1.4,
        mean_mm: [0.0, 0.0, 1.2],
        area_m2: 2.2,
        largest_mm: 1.9,
        interval_mm: [1.7, 2.1],
    };
    let zones = if is_bulged { vec![zone] } else { Vec::new() };
    Case {
        deformation: Some(DeformationVerdict {
            shown: is_bulged,
            p: Some(if is_bulged { 1e-9 } else { 0.4 }),
            largest_mm: is_bulged.then_some(1.9),
            interval_mm: is_bulged.then_some([1.7, 2.1]),
            detection_limit_mm: [Some(0.6), Some(0.4), None],
            detection_limit_in_face_mm: [Some(1.2), Some(0.7), None],
            zones,
        }),
        ..wall(0, 0.0, 1)
    }
}

#[test]
fn fine_needs_the_shape_too() {
    let none = Thresholds::default();
    let kept = judge(&bulged(false), &none);
    assert_eq!(kept.state, State::Fine, "{}", kept.sentence);
    let words = "no change of the shape of the wall is shown (detection limits for a zone of 1 m: 0.60 mm out of the wall, 1.2 mm in its face)";
    assert!(kept.sentence.contains(words), "{}", kept.sentence);
    let changed = judge(&bulged(true), &none);
    assert_eq!(codes(&changed), [ReasonCode::DeformationShown]);
    assert_eq!(changed.state, State::Attention);
    let words = "the wall changed its shape in 1 zone; a zone of 2.1 x 1.4 m bulged by 1.9 mm against the rest of the wall (95 % interval 1.7 to 2.1 mm)";
    assert!(changed.sentence.contains(words), "{}", changed.sentence);
    // Nothing of the datum is in it.
    let unknown = Case {
        datum: Some(DatumState::Unknown),
        ..bulged(true)
    };
    assert_eq!(judge(&unknown, &none).state, State::Attention);
    let german = assess(&bulged(true), &none, Texts::of(Language::German)).sentence;
    let words = "eine Zone von 2,1 x 1,4 m hat sich gegenüber der übrigen Mauer um 1,9 mm ausgebaucht (95-%-Intervall 1,7 bis 2,1 mm)";
    assert!(german.contains(words), "{german}");
}

#[test]
fn deformations_have_thresholds_of_their_own_or_those_of_lengths() {
    for (text, state, code) in [
        (
            "deformation_attention_mm = 1.0",
            State::Attention,
            ReasonCode::Attention(Quantity::Deformation),
        ),
        (
            "deformation_alarm_mm = 1.5",
            State::Alarm,
            ReasonCode::Alarm(Quantity::Deformation),
        ),
        (
            "deformation_attention_mm = 2.0",
            State::CannotTell,
            ReasonCode::DeformationReachesThreshold,
        ),
        ("attention_mm = 5.0", State::Fine, ReasonCode::BelowThresholds),
    ] {
        let verdict = judge(&bulged(true), &thresholds(text));
        assert_eq!(
            (verdict.state, codes(&verdict)[0]),
            (state, code),
            "{text}: {}",
            verdict.sentence
        );
        assert_eq!(verdict.deformation.unwrap().zones[0].state, state, "{text}");
    }

    let doubted = Case {
        in_doubt: true,
        ..bulged(true)
    };
    let verdict = judge(&doubted, &thresholds("deformation_alarm_mm = 1.0"));
    assert_eq!(verdict.state, State::CannotTell);
    assert!(!verdict.sentence.contains("bulged"), "{}", verdict.sentence);
}

#[test]
fn the_sentence_says_how_many_stones_it_says_nothing_of() {
    let mut case = wall(0, 0.0, 5);
    let many = 30;
    for stone in case.stones.iter_mut().take(many) {
        stone.measured = None;
    }
    let said = |case: &Case| judge(case, &Thresholds::default()).sentence;
    assert!(
        said(&case).ends_with("; 30 of 100 stones were not measured."),
        "{}",
        said(&case)
    );
    for stone in case.stones.iter_mut().take(many) {
        stone.is_masonry = false;
    }
    assert!(!said(&case).contains("not measured"), "{}", said(&case));
}
