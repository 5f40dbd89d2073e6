//! Thresholds as they are set in practice, on made-up walls whose true motion is known.

use super::case::{Case, TimeCase};
use super::judged::Compared;
use super::testing::Normal;
use super::tests::{bulged, codes, judge, stone, thresholds, wall};
use nalgebra::Vector3;
use stonewise_base::thresholds::{Level, Quantity};
use stonewise_results::records::{DatumState, ReasonCode, State};

/// A still wall of 100 stones, of which one truly moved by this: millimetres along the wall, up and out.
fn one_moved(mm: [f64; 3]) -> Case {
    let mut case = wall(0, 0.0, 11);
    let moved = Vector3::from(mm) / 1e3;
    case.stones[50] = stone(51, [0.0, 5.0], moved, &mut Normal::new(3));
    case
}

#[test]
fn each_side_of_an_axis_has_its_thresholds() {
    use Level::{Alarm, Attention};
    for (axis, name, quantity) in [
        (0, "along", Quantity::Along),
        (1, "up", Quantity::Up),
        (2, "out", Quantity::Out),
    ] {
        let text = format!("{name}_attention_mm = [-5, 10]\n{name}_alarm_mm = [-8, 20]");
        for (moved_mm, state, decided) in [
            (-12.0, State::Alarm, Some((Alarm, -8.0))),
            (-7.0, State::Attention, Some((Attention, -5.0))),
            (-5.0, State::CannotTell, Some((Attention, -5.0))),
            (-3.0, State::Fine, None),
            (7.0, State::Fine, None),
            (10.0, State::CannotTell, Some((Attention, 10.0))),
            (14.0, State::Attention, Some((Attention, 10.0))),
            (23.0, State::Alarm, Some((Alarm, 20.0))),
        ] {
            let mut mm = [0.0; 3];
            mm[axis] = moved_mm;
            // Motions along the other axes do not count.
            mm[(axis + 1) % 3] = -30.0;
            let verdict = judge(&one_moved(mm), &thresholds(&text));
            assert_eq!(verdict.state, state, "{name} {moved_mm}: {}", verdict.sentence);
            for found in [verdict.wall.decided_by, verdict.stones[50].decided_by] {
                let threshold = found.map(|d| d.threshold);
                let expected = decided.map(|(level, limit)| (quantity, level, limit));
                assert_eq!(threshold.map(|t| (t.quantity, t.level, t.limit)), expected);
                if let Some([low, high]) = found.and_then(|d| d.interval) {
                    // 1.96 standard deviations of 0.5 mm to either side of what was measured.
                    assert!((high - low - 1.96).abs() < 0.01 && low < moved_mm && moved_mm < high);
                }
            }
        }
    }
    let settled = judge(
        &one_moved([0.0, -12.0, 0.0]),
        &thresholds("up_alarm_mm = [-8, 20]"),
    );
    let words = "Alarm: 1 stone moved beyond the alarm threshold of -8 mm (up); ";
    assert!(settled.sentence.starts_with(words), "{}", settled.sentence);
}

#[test]
fn the_motion_of_two_epochs_over_their_years_is_a_rate() {
    let rates = thresholds("rate_attention_mm_per_year = 4.0\nrate_alarm_mm_per_year = 8.0");
    let after = |years: Option<f64>| {
        let mut case = one_moved([12.0, 0.0, 0.0]);
        case.time = TimeCase::Pair(years);
        judge(&case, &rates)
    };
    for (years, state) in [
        (1.0, State::Alarm),
        (2.0, State::Attention),
        (3.0, State::CannotTell),
        (6.0, State::Fine),
    ] {
        assert_eq!(after(Some(years)).state, state, "{years}");
    }
    let faster = "1 stone moves faster than the alarm threshold of 8 mm a year";
    assert!(after(Some(1.0)).sentence.contains(faster));
    let undated = after(None);
    assert_eq!(codes(&undated), [ReasonCode::NotJudged(Quantity::Rate)]);
    let words =
        "Cannot tell: velocities cannot be compared with their thresholds: give the dates of both epochs";
    assert!(undated.sentence.starts_with(words), "{}", undated.sentence);
    let decided = undated.wall.decided_by.unwrap();
    assert_eq!((decided.threshold.limit, decided.interval), (4.0, None));

    // A motion of the wall as a whole would be a rate, too.
    let mut case = one_moved([0.0; 3]);
    (case.time, case.datum) = (TimeCase::Pair(Some(1.0)), Some(DatumState::Unknown));
    assert_eq!(codes(&judge(&case, &rates)), [ReasonCode::DatumUnknown]);
}

/// The newest epoch of a series on a still wall: `known` stones have a rate of 1 mm a year and no departure.
fn newest(known: usize) -> Case {
    let mut case = wall(0, 0.0, 12);
    case.time = TimeCase::Newest;
    for stone in &mut case.stones[..known] {
        let still = |interval| {
            Some(Compared {
                interval,
                moved: false,
            })
        };
        (stone.rate, stone.departure) = (still([0.0, 2.0]), still([0.0, 0.0]));
    }
    case
}

#[test]
fn rates_and_departures_of_a_series_are_judged_with_its_newest_epoch() {
    for (keys, quantity) in [
        (
            "rate_attention_mm_per_year = 3\nrate_alarm_mm_per_year = 6",
            Quantity::Rate,
        ),
        (
            "departure_attention_sd = 3\ndeparture_alarm_sd = 6",
            Quantity::Departure,
        ),
    ] {
        let set = thresholds(keys);
        let with = |interval: [f64; 2], moved| {
            let mut case = newest(100);
            let compared = Some(Compared { interval, moved });
            match quantity {
                Quantity::Rate => case.stones[7].rate = compared,
                _ => case.stones[7].departure = compared,
            }
            judge(&case, &set)
        };
        for (interval, moved, state) in [
            ([4.0, 5.0], true, State::Attention),
            ([7.0, 8.0], true, State::Alarm),
            ([4.0, 5.0], false, State::CannotTell),
            ([1.0, 2.0], true, State::Fine),
        ] {
            let verdict = with(interval, moved);
            assert_eq!(verdict.state, state, "{keys} {interval:?}: {}", verdict.sentence);
            assert_eq!(verdict.stones[7].state, state);
        }
        // Velocities are against the part of the wall that kept its shape, whatever the datum.
        let mut case = newest(100);
        case.datum = Some(DatumState::Unknown);
        assert_eq!(judge(&case, &set).state, State::Fine);

        // Some stones are hidden in too many epochs; of most something must be known.
        assert_eq!(judge(&newest(60), &set).state, State::Fine);
        assert_eq!(judge(&newest(60), &set).stones[80].state, State::CannotTell);
        for case in [newest(40), wall(0, 0.0, 12)] {
            assert_eq!(codes(&judge(&case, &set)), [ReasonCode::NotJudged(quantity)]);
        }
        let mut earlier = newest(0);
        earlier.time = TimeCase::Earlier;
        assert_eq!(judge(&earlier, &set).state, State::Fine);
    }
    let departed = judge(&wall(0, 0.0, 12), &thresholds("departure_alarm_sd = 4"));
    assert!(departed.sentence.contains("a model needs four epochs with dates"));
}

#[test]
fn a_deformation_is_judged_by_the_zone_that_holds_its_middle() {
    // The bulge of 1.9 mm lies at (4, 2).
    let zone = |corners: &str, key: &str| {
        thresholds(&format!(
            "deformation_alarm_mm = 50.0\n[[zones]]\nname = \"a\"\npolygon = {corners}\n{key} = 1.5"
        ))
    };
    let around = "[[3, 1], [5, 1], [5, 3], [3, 3]]";
    let beside = "[[6, 1], [8, 1], [8, 3], [6, 3]]";
    for (corners, state) in [(around, State::Alarm), (beside, State::Fine)] {
        let verdict = judge(&bulged(true), &zone(corners, "deformation_alarm_mm"));
        let found = &verdict.deformation.as_ref().unwrap().zones[0];
        assert_eq!(
            (verdict.state, found.state),
            (state, state),
            "{}",
            verdict.sentence
        );
        assert_eq!(verdict.zones[0].area.state, state);
        let limit = found.decided_by.map(|d| d.threshold.limit);
        assert_eq!(limit, (state == State::Alarm).then_some(1.5));
    }
}
