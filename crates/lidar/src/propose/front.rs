//! Which points nothing beats.

use super::point::Costs;

/// Whether `a` is nowhere worse than `b`, and somewhere better.
pub fn dominates(a: &Costs, b: &Costs) -> bool {
    a.iter().zip(b).all(|(a, b)| a <= b) && a != b
}

/// The items that no other dominates, by their costs, the least of the first cost first. Of equal ones the first stays.
pub fn front<T>(mut items: Vec<T>, costs: impl Fn(&T) -> Costs) -> Vec<T> {
    let in_order = |a: &Costs, b: &Costs| {
        let pairs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
        pairs.fold(std::cmp::Ordering::Equal, |order, next| order.then(next))
    };
    items.sort_by(|a, b| in_order(&costs(a), &costs(b)));
    // In this order nothing dominates what comes before it.
    let mut kept: Vec<(Costs, T)> = Vec::new();
    for item in items {
        let own = costs(&item);
        let beats = |(other, _): &(Costs, T)| other.iter().zip(&own).all(|(a, b)| a <= b);
        // Neighbours in the first cost are the likeliest to beat it.
        if !kept.iter().rev().any(beats) {
            kept.push((own, item));
        }
    }
    kept.into_iter().map(|(_, item)| item).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Against every point beside every other; few values, so that many are equal.
        #[test]
        fn the_front_is_what_no_other_dominates(points in prop::collection::vec([0u8..6, 0..6, 0..6, 0..6, 0..3], 0..60)) {
            let points: Vec<Costs> = points.into_iter().map(|p| p.map(f64::from)).collect();
            let found = front(points.clone(), |point| *point);
            let mut slow: Vec<Costs> = Vec::new();
            for point in &points {
                if !points.iter().any(|other| dominates(other, point)) && !slow.contains(point) {
                    slow.push(*point);
                }
            }
            prop_assert_eq!(found.len(), slow.len());
            prop_assert!(slow.iter().all(|point| found.contains(point)));
        }
    }
}
