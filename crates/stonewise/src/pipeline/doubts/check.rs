//! A check of the results of a pair of epochs, whether it passes or not.

use crate::report_params::Language;
use crate::results::records::CheckRecord;
use crate::texts::{Message, Said};

/// Words in English and in German.
type Words = [&'static str; 2];

/// What is checked, and against what.
pub(super) struct Rule {
    /// The statistic in plain words.
    pub what: Words,
    /// What it is compared with.
    pub limit: Limit,
    /// Where the limit is from.
    pub source: Words,
    /// What is said where the check fails; its code is the name of the check.
    pub message: &'static Message,
    /// What to do where the check fails, said after the message.
    pub remedy: Words,
}

/// On which side of a number a statistic must lie.
#[derive(Clone, Copy)]
pub(super) enum Limit {
    AtLeast(f64),
    AtMost(f64),
}

impl Rule {
    /// Whether the statistic lies on the right side of the limit.
    pub fn passes(&self, statistic: f64) -> bool {
        match self.limit {
            Limit::AtLeast(limit) => statistic >= limit,
            Limit::AtMost(limit) => statistic <= limit,
        }
    }

    /// The check of a statistic; `values`: those of the message.
    pub fn check<const N: usize>(
        &'static self,
        statistic: f64,
        values: impl FnOnce() -> [(&'static str, Said); N],
    ) -> Check {
        Check {
            rule: self,
            statistic,
            doubt: (!self.passes(statistic)).then(|| self.message.say(&values()).and(self.remedy)),
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
    /// The check of this epoch as registration.json has it, in the language of the report.
    pub fn record(&self, epoch: &str, language: Language) -> CheckRecord {
        let in_language = |[english, german]: Words| match language {
            Language::English => english.to_owned(),
            Language::German => german.to_owned(),
        };
        let (limit, at_least) = match self.rule.limit {
            Limit::AtLeast(limit) => (limit, true),
            Limit::AtMost(limit) => (limit, false),
        };
        CheckRecord {
            name: self.rule.message.code.unwrap_or_default().to_owned(),
            what: in_language(self.rule.what),
            epoch: epoch.to_owned(),
            statistic: self.statistic,
            limit,
            at_least,
            source: in_language(self.rule.source),
            passed: self.doubt.is_none(),
            remedy: self.doubt.as_ref().map(|_| in_language(self.rule.remedy)),
        }
    }
}

#[cfg(test)]
pub(super) fn said(check: Option<Check>) -> Option<Said> {
    check.and_then(|check| check.doubt)
}
