//! A check of the results of a pair of epochs, whether it passes or not.

use crate::report_params::Language;
use crate::results::records::CheckRecord;
use crate::texts::{Message, Said};

/// What is checked, and against what. Under the name of the check, the files of texts say `what` the statistic is, the
/// `source` of the limit, and the `remedy` where the check fails, which is said after the message.
pub(super) struct Rule {
    /// What it is compared with.
    pub limit: Limit,
    /// What is said where the check fails; its code is the name of the check.
    pub message: &'static Message,
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

    /// The name of the check.
    pub fn name(&self) -> &'static str {
        self.message.code.unwrap_or_default()
    }

    /// What the file of a language says of the rule.
    pub fn text(&self, what: &str, language: Language) -> &'static str {
        language.text(&format!("checks.{}.{what}", self.name()))
    }

    /// The check of a statistic; `values`: those of the message.
    pub fn check<const N: usize>(
        &'static self,
        statistic: f64,
        values: impl FnOnce() -> [(&'static str, Said); N],
    ) -> Check {
        let remedy = |language| self.text("remedy", language);
        Check {
            rule: self,
            statistic,
            doubt: (!self.passes(statistic)).then(|| self.message.say(&values()).and(remedy)),
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
        let text = |what| self.rule.text(what, language).to_owned();
        let (limit, at_least) = match self.rule.limit {
            Limit::AtLeast(limit) => (limit, true),
            Limit::AtMost(limit) => (limit, false),
        };
        CheckRecord {
            name: self.rule.name().to_owned(),
            what: text("what"),
            epoch: epoch.to_owned(),
            statistic: self.statistic,
            limit,
            at_least,
            source: text("source"),
            passed: self.doubt.is_none(),
            remedy: self.doubt.as_ref().map(|_| text("remedy")),
        }
    }
}

#[cfg(test)]
pub(super) fn said(check: Option<Check>) -> Option<Said> {
    check.and_then(|check| check.doubt)
}
