//! Order statistics of finite values.

/// Sorted finite values.
#[derive(Clone, Debug, PartialEq)]
pub struct Sorted(Vec<f64>);

impl Sorted {
    /// Sorts the finite ones among the values.
    pub fn new(values: impl IntoIterator<Item = f64>) -> Self {
        let mut all: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        Self(all)
    }

    /// The values, ascending.
    pub fn values(&self) -> &[f64] {
        &self.0
    }

    /// Value at a share 0 to 1 of the order, linear between neighbours; `None` where there are no values.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let place = share.clamp(0.0, 1.0) * self.0.len().checked_sub(1)? as f64;
        let (low, t) = (place.floor() as usize, place.fract());
        let high = (low + 1).min(self.0.len() - 1);
        Some(self.0[low] * (1.0 - t) + self.0[high] * t)
    }

    /// The median; `None` where there are no values.
    pub fn median(&self) -> Option<f64> {
        self.quantile(0.5)
    }

    /// 1.4826 times the median distance from the median: the standard deviation of a normal distribution.
    pub fn nmad(&self) -> Option<f64> {
        let median = self.median()?;
        Self::new(self.0.iter().map(|v| (v - median).abs()))
            .median()
            .map(|d| 1.4826 * d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours_and_skip_what_is_not_finite() {
        let sorted = Sorted::new([3.0, f64::NAN, 1.0, 2.0, f64::INFINITY, 4.0]);
        assert_eq!(sorted.values(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(sorted.median(), Some(2.5));
        assert_eq!(sorted.quantile(1.0), Some(4.0));
        assert_eq!(sorted.nmad(), Some(1.4826));
        assert_eq!(Sorted::new([]).nmad(), None);
    }
}
