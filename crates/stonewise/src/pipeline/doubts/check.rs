//! A check of the results of a pair of epochs, whether it passes or not.

use crate::results::records::CheckRecord;
use crate::texts::{Message, Said};

/// What is checked, and against what.
pub(super) struct Rule {
    /// What is said where the check fails; its code is the name of the check.
    pub message: &'static Message,
    pub limit: f64,
    /// Where the limit is from.
    pub source: &'static str,
    /// What to do where the check fails.
    pub remedy: &'static str,
}

impl Rule {
    /// The check with its statistic; `doubt`: what is said if it fails.
    pub fn check(&'static self, statistic: f64, doubt: Option<Said>) -> Check {
        Check {
            rule: self,
            statistic,
            doubt,
        }
    }
}

/// A rule and what a pair of epochs shows.
pub(super) struct Check {
    rule: &'static Rule,
    statistic: f64,
    /// What is said of a check that fails.
    pub doubt: Option<Said>,
}

impl Check {
    /// The check as registration.json has it.
    pub fn record(&self) -> CheckRecord {
        CheckRecord {
            name: self.rule.message.code.unwrap_or_default().to_owned(),
            statistic: self.statistic,
            limit: self.rule.limit,
            source: self.rule.source.to_owned(),
            remedy: self.rule.remedy.to_owned(),
            passed: self.doubt.is_none(),
        }
    }
}

#[cfg(test)]
pub(super) fn said(check: Option<Check>) -> Option<Said> {
    check.and_then(|check| check.doubt)
}
