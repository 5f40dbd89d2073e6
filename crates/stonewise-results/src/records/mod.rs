//! Result files of one value each, written and read by the same type.

mod datum;
mod instruments;
mod registration;
mod remarks;
mod run;
mod timestamp;
mod trends;
mod verdict;

pub use datum::{Datum, DatumState, SourceError};
pub use instruments::{
    ComparedInstrument, DatumUse, INSTRUMENTS_VERSION, InstrumentsEpoch, InstrumentsRecord,
    LeftOutInstrument, WhyLeftOut,
};
pub use registration::{
    AdjustmentRecord, CheckRecord, DeformationRecord, EstimatorRecord, GicpRecord, InfluenceRecord,
    ObserversRecord, PhotosRecord, RegistrationRecord,
};
pub use remarks::{Remark, Remarks, Signature, signed_digest};
pub use run::{CrsRecord, EpochRecord, InputRecord, PhotoScale, ProjectRecord, RunRecord, StepTime};
pub use timestamp::Timestamp;
pub use trends::{
    ConditionRecord, CurvePoint, EstimateRecord, InseparableRecord, PathPoint, SeasonRecord, TRENDS_VERSION,
    TrendsRecord, ZoneTrend,
};
pub use verdict::{
    AnswerVerdict, Area, Decision, DeformationVerdict, DeformedZone, DetectionLimit, EpochVerdict, Headline,
    Headlines, JointVerdict, Largest, Reason, ReasonCode, SeriesVerdict, State, StoneVerdict,
    VERDICT_VERSION, Verdict, ZoneVerdict,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{registration_record, run_record};
    use serde::Serialize;
    use serde::de::DeserializeOwned;
    use stonewise_base::files::{read_json, write_readable_json};
    use stonewise_core::evaluate::{Evaluation, EvaluationParams, score_motions};
    use stonewise_core::id::StoneId;
    use stonewise_core::matching::MatchReport;
    use stonewise_core::stone::{MatchOutcome, UnmatchedReason};

    fn comes_back<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(record: &T) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record.json");
        write_readable_json(&path, record).unwrap();
        assert_eq!(&read_json::<T>(&path).unwrap(), record);
    }

    #[test]
    fn every_record_comes_back_as_it_was_written() {
        comes_back(&run_record("Wall", &["A", "B", "C"]));
        comes_back(&registration_record());
        let gicp = GicpRecord {
            stones: 9,
            measured: 8,
            loose: 1,
        };
        comes_back(&RegistrationRecord {
            estimator: EstimatorRecord::Gicp(gicp),
            datum: Datum::unknown(&nalgebra::Point3::new(1.0, 2.0, 3.0), "unknown".to_owned()),
            observers: None,
            deformation: None,
            checks: Vec::new(),
            influence: Vec::new(),
        });
        let params = EvaluationParams::default();
        let mut evaluation = Evaluation::new("the motion in the project file", &params);
        evaluation.stones = Some(score_motions(&[], 3, &params));
        comes_back(&evaluation);
        let matched = MatchOutcome::Matched { second: StoneId(7) };
        let lost = MatchOutcome::Unmatched(UnmatchedReason::Lost);
        comes_back(&MatchReport {
            outcomes: vec![(StoneId(1), matched), (StoneId(2), lost)],
            qualities: Vec::new(),
            unmatched_second: vec![StoneId(3)],
            common_shift: nalgebra::Vector3::new(0.1, 0.0, -0.2),
            local_shifts: Vec::new(),
        });
    }
}
