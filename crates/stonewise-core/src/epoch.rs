//! Epochs of a survey: which one, a value for each, and pairs of the reference with a later one.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Deref, DerefMut, Index, IndexMut};

/// An epoch of a survey: its place in the list of epochs, of which the reference is the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EpochId(usize);

impl EpochId {
    /// The epoch from which motions count.
    pub const REFERENCE: Self = Self(0);

    /// The epoch at this index of the list, from 0.
    pub const fn at(index: usize) -> Self {
        Self(index)
    }

    /// Its index in the list, from 0.
    pub const fn index(self) -> usize {
        self.0
    }

    /// Its number as people and file names count, from 1.
    pub const fn number(self) -> usize {
        self.0 + 1
    }

    /// Whether motions count from it.
    pub const fn is_reference(self) -> bool {
        self.0 == 0
    }
}

impl fmt::Display for EpochId {
    /// The number from 1.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.number().fmt(f)
    }
}

/// A value for each epoch of a survey, the reference first.
///
/// It is a list that is indexed by [`EpochId`] only.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Epochs<T>(Vec<T>);

impl<T> Epochs<T> {
    /// The epochs that there are.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = EpochId> + ExactSizeIterator + use<T> {
        (0..self.0.len()).map(EpochId)
    }

    /// All epochs but the reference.
    pub fn later_ids(&self) -> impl DoubleEndedIterator<Item = EpochId> + ExactSizeIterator + use<T> {
        (1..self.0.len().max(1)).map(EpochId)
    }

    /// Values with their epochs.
    pub fn with_ids(&self) -> impl Iterator<Item = (EpochId, &T)> {
        self.ids().zip(&self.0)
    }

    /// The value of the epoch from which motions count. It panics where there is no epoch at all.
    pub fn reference(&self) -> &T {
        &self[EpochId::REFERENCE]
    }

    /// The values of the reference and of another epoch. It panics where there is no such epoch.
    pub fn pair(&self, later: EpochId) -> Pair<&T> {
        Pair::new(self.reference(), &self[later])
    }

    /// Removes all epochs beyond this number of them.
    pub fn truncate(&mut self, count: usize) {
        self.0.truncate(count);
    }

    /// What a function makes of each value.
    pub fn map<'a, U>(&'a self, of: impl FnMut(&'a T) -> U) -> Epochs<U> {
        self.0.iter().map(of).collect()
    }
}

impl<T> FromIterator<T> for Epochs<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T> From<Vec<T>> for Epochs<T> {
    fn from(values: Vec<T>) -> Self {
        Self(values)
    }
}

impl<T> Index<EpochId> for Epochs<T> {
    type Output = T;

    fn index(&self, epoch: EpochId) -> &T {
        &self.0[epoch.0]
    }
}

impl<T> IndexMut<EpochId> for Epochs<T> {
    fn index_mut(&mut self, epoch: EpochId) -> &mut T {
        &mut self.0[epoch.0]
    }
}

impl<T> Deref for Epochs<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T> DerefMut for Epochs<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

impl<'a, T> IntoIterator for &'a Epochs<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// Values of the reference and of a later epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair<T> {
    /// Value of the reference.
    pub first: T,
    /// Value of the later epoch.
    pub later: T,
}

impl<T> Pair<T> {
    /// Both values.
    pub const fn new(first: T, later: T) -> Self {
        Self { first, later }
    }

    /// What a function makes of each value.
    pub fn map<U>(self, mut of: impl FnMut(T) -> U) -> Pair<U> {
        Pair::new(of(self.first), of(self.later))
    }

    /// Both values by reference.
    pub const fn each_ref(&self) -> Pair<&T> {
        Pair::new(&self.first, &self.later)
    }

    /// The values with those of another pair.
    pub fn zip<U>(self, other: Pair<U>) -> Pair<(T, U)> {
        Pair::new((self.first, other.first), (self.later, other.later))
    }

    /// The reference's value, then the other.
    pub fn into_array(self) -> [T; 2] {
        [self.first, self.later]
    }
}

impl<T> IntoIterator for Pair<T> {
    type Item = T;
    type IntoIter = std::array::IntoIter<T, 2>;

    /// The reference's value, then the other.
    fn into_iter(self) -> Self::IntoIter {
        self.into_array().into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_gives_its_reference_its_later_epochs_and_its_pairs() {
        let years = Epochs::from(vec![2023, 2024, 2026]);
        assert_eq!(*years.reference(), 2023);
        let later: Vec<(usize, i32)> = years.later_ids().map(|e| (e.number(), years[e])).collect();
        assert_eq!(later, [(2, 2024), (3, 2026)]);
        let pair = years.pair(EpochId::at(2));
        assert_eq!((pair.first, pair.later), (&2023, &2026));
        assert_eq!(pair.map(|y| y - 2000).into_array(), [23, 26]);
        assert_eq!(Epochs::<i32>::default().later_ids().count(), 0);
    }

    #[test]
    fn people_count_epochs_from_one_and_lists_are_plain_json() {
        assert_eq!(format!("ingest-{}", EpochId::REFERENCE), "ingest-1");
        let list = Epochs::from(vec![1, 2]);
        assert_eq!(serde_json::to_string(&list).unwrap(), "[1,2]");
    }
}
