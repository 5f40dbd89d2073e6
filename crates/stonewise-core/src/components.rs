//! Connected components of graphs.

/// The connected components of an undirected graph of `count` nodes, in the order of their lowest nodes; the nodes of
/// each in the order of a breadth-first search from the lowest. `neighbours`: of a node; every edge at both of its ends.
pub fn components<N: IntoIterator<Item = usize>>(
    count: usize,
    neighbours: impl Fn(usize) -> N,
) -> Vec<Vec<usize>> {
    let mut components = Vec::new();
    let mut is_reached = vec![false; count];
    for start in 0..count {
        if is_reached[start] {
            continue;
        }
        is_reached[start] = true;
        let mut component = vec![start];
        let mut done = 0;
        while done < component.len() {
            for node in neighbours(component[done]) {
                if !std::mem::replace(&mut is_reached[node], true) {
                    component.push(node);
                }
            }
            done += 1;
        }
        components.push(component);
    }
    components
}

#[cfg(test)]
mod tests {
    use super::components;

    #[test]
    fn nodes_are_together_where_edges_lead_from_one_to_the_other() {
        let neighbours = [vec![4], vec![], vec![3, 5], vec![2], vec![0], vec![2]];
        let found = components(6, |node| neighbours[node].iter().copied());
        assert_eq!(found, [vec![0, 4], vec![1], vec![2, 3, 5]]);
        assert!(components(0, |_| []).is_empty());
    }
}
