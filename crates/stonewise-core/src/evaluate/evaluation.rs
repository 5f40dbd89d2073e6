//! The whole evaluation of one pair of epochs, as written to evaluation.json.

use crate::evaluate::{
    EvaluationParams, MotionScore, NeighbourScore, RotationScore, TruthScore, definitions,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All that is known about how right a pair of epochs came out; parts without a truth are absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Where the truth comes from: the motion in the project file, or a file of true stones.
    pub truth: String,
    /// Limits that the figures depend on.
    pub params: EvaluationParams,
    /// What the figures mean.
    pub definitions: BTreeMap<String, String>,
    /// Stone motions against a known field; for an external truth see `external`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub stones: Option<MotionScore>,
    /// M3C2 against the same truth.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub m3c2: Option<MotionScore>,
    /// Stone motions against an external truth, missing stones included.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub external: Option<TruthScore>,
    /// Motions of neighbours relative to each other, compared with an external truth.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub neighbours: Option<NeighbourScore>,
    /// Rotations of stones, compared with an external truth.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rotations: Option<RotationScore>,
}

impl Evaluation {
    /// An evaluation with its definitions and no figures yet.
    pub fn new(truth: impl Into<String>, params: &EvaluationParams) -> Self {
        Self {
            truth: truth.into(),
            params: params.clone(),
            definitions: definitions(),
            stones: None,
            m3c2: None,
            external: None,
            neighbours: None,
            rotations: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::score_motions;

    #[test]
    fn an_evaluation_survives_json_and_explains_its_figures() {
        let params = EvaluationParams::default();
        let mut evaluation = Evaluation::new("translation", &params);
        evaluation.stones = Some(score_motions(&[], 3, &params));
        let json = serde_json::to_string(&evaluation).unwrap();
        assert!(!json.contains("m3c2\":{\"expected"));
        assert_eq!(serde_json::from_str::<Evaluation>(&json).unwrap(), evaluation);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        for direction in value["stones"]["errors"].as_object().unwrap().keys() {
            assert!(
                evaluation.definitions.contains_key(direction),
                "{direction} is not explained"
            );
        }
    }
}
