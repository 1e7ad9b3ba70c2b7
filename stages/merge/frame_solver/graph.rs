//! The pose graph: robots, the alignments between them, and the cycles that they close.

use super::UncertainPose;

/// An alignment of two robots, given by their indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The robot whose map is fixed.
    pub a: usize,
    /// The robot whose map is moved.
    pub b: usize,
    /// `T_a_b`.
    pub transform_a_b: UncertainPose,
}

impl Edge {
    /// The robot at the other end.
    pub fn other(&self, robot: usize) -> usize {
        if robot == self.a { self.b } else { self.a }
    }

    /// `T_robot_other` for the robot at either end.
    pub fn transform_from(&self, robot: usize) -> UncertainPose {
        if robot == self.a { self.transform_a_b } else { self.transform_a_b.inverse() }
    }
}

/// A cycle of alignments with the product of its transforms, which is the identity if they agree.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// The edges; the first is the closing one.
    pub edges: Vec<usize>,
    /// The product of the transforms round the cycle.
    pub remainder: UncertainPose,
}

/// Edges of a pose graph by robot.
#[derive(Clone, Debug)]
pub struct Neighbours {
    edges_of: Vec<Vec<usize>>,
    /// Least spread of the edges of each robot.
    least_spread: Vec<f64>,
}

impl Neighbours {
    /// Sorts all edges by their ends.
    pub fn new(robots: usize, edges: &[Edge]) -> Self {
        let mut edges_of = vec![Vec::new(); robots];
        let mut least_spread = vec![f64::INFINITY; robots];
        for (index, edge) in edges.iter().enumerate() {
            for robot in [edge.a, edge.b] {
                edges_of[robot].push(index);
                least_spread[robot] = edge.transform_a_b.spread().min(least_spread[robot]);
            }
        }
        Self { edges_of, least_spread }
    }

    /// The edges of a robot, by rising index.
    pub fn of(&self, robot: usize) -> &[usize] {
        &self.edges_of[robot]
    }

    /// The cycle that an edge closes with the path of least variance between its ends over the other edges for which
    /// `used` holds (Dijkstra's algorithm on [`UncertainPose::spread`]). `None` if there is no such path.
    pub fn cycle(&self, edges: &[Edge], closing: usize, used: impl Fn(usize) -> bool) -> Option<Cycle> {
        let Edge { a, b, transform_a_b } = edges[closing];
        let mut cost = vec![f64::INFINITY; self.edges_of.len()];
        let mut reached = vec![false; self.edges_of.len()];
        let mut parent = vec![None; self.edges_of.len()];
        cost[a] = 0.0;
        let mut border = vec![a];
        while let Some(robot) = take_cheapest(&mut border, &cost) {
            // No remaining path to the goal can be shorter.
            if robot == b || cost[robot] + self.least_spread[b] >= cost[b] {
                break;
            }
            reached[robot] = true;
            for &index in self.of(robot).iter().filter(|&&index| index != closing && used(index)) {
                let next = edges[index].other(robot);
                let through = cost[robot] + edges[index].transform_a_b.spread();
                // A node as far away as the goal is on no shorter path.
                if !reached[next] && through < cost[next].min(cost[b]) {
                    if parent[next].is_none() {
                        border.push(next);
                    }
                    cost[next] = through;
                    parent[next] = Some((index, robot));
                }
            }
        }
        let mut on_cycle = vec![closing];
        let mut transform_b_a = UncertainPose::identity();
        let mut robot = b;
        while robot != a {
            let (through, before) = parent[robot]?;
            on_cycle.push(through);
            transform_b_a = transform_b_a.then(&edges[through].transform_from(robot));
            robot = before;
        }
        Some(Cycle { edges: on_cycle, remainder: transform_a_b.then(&transform_b_a) })
    }
}

/// Spanning trees of the pose graph: for every robot the path of least accumulated variance to the root of its tree.
#[derive(Clone, Debug)]
pub struct Forest {
    /// For every robot: the edge to its parent, and the parent. `None` for a root.
    parent: Vec<Option<(usize, usize)>>,
    depth: Vec<usize>,
    /// The robots in the order they were reached: parents first.
    order: Vec<usize>,
}

impl Forest {
    /// Grows trees over the edges for which `used` holds: one from `first`, then from the robots not yet reached, by
    /// index (Dijkstra's algorithm on [`UncertainPose::spread`]).
    pub fn grow(robots: usize, edges: &[Edge], first: usize, used: impl Fn(usize) -> bool) -> Self {
        let neighbours = Neighbours::new(robots, edges);
        let mut forest = Self { parent: vec![None; robots], depth: vec![0; robots], order: Vec::with_capacity(robots) };
        let mut cost = vec![f64::INFINITY; robots];
        let mut reached = vec![false; robots];
        for root in std::iter::once(first).chain(0..robots) {
            if root >= robots || reached[root] {
                continue;
            }
            cost[root] = 0.0;
            let mut border = vec![root];
            while let Some(robot) = take_cheapest(&mut border, &cost) {
                reached[robot] = true;
                forest.order.push(robot);
                for &index in neighbours.of(robot).iter().filter(|&&index| used(index)) {
                    let next = edges[index].other(robot);
                    let through = cost[robot] + edges[index].transform_a_b.spread();
                    if reached[next] || through >= cost[next] {
                        continue;
                    }
                    if forest.parent[next].is_none() {
                        border.push(next);
                    }
                    cost[next] = through;
                    forest.parent[next] = Some((index, robot));
                    forest.depth[next] = forest.depth[robot] + 1;
                }
            }
        }
        forest
    }

    /// Whether the edge is part of a tree.
    pub fn contains(&self, index: usize, edge: &Edge) -> bool {
        [edge.a, edge.b].iter().any(|&robot| self.parent[robot].is_some_and(|(through, _)| through == index))
    }

    /// The cycle that an edge outside of the trees closes with them. `None` if its ends are in different trees.
    pub fn cycle(&self, edges: &[Edge], closing: usize) -> Option<Cycle> {
        let edge = &edges[closing];
        let (mut on_cycle, transform_b_a) = self.path(edges, edge.b, edge.a)?;
        on_cycle.insert(0, closing);
        Some(Cycle { edges: on_cycle, remainder: edge.transform_a_b.then(&transform_b_a) })
    }

    /// The edges along the trees between two robots, in no order, and `T_from_to` along them. `None` if the robots
    /// are in different trees.
    pub fn path(&self, edges: &[Edge], from: usize, to: usize) -> Option<(Vec<usize>, UncertainPose)> {
        let mut sides = [(from, UncertainPose::identity()), (to, UncertainPose::identity())];
        let mut on_path = Vec::new();
        while sides[0].0 != sides[1].0 {
            // The deeper side goes up first, so that both meet at their nearest common ancestor.
            let deeper = usize::from(self.depth[sides[1].0] > self.depth[sides[0].0]);
            let (robot, transform_end_robot) = &mut sides[deeper];
            let (through, parent) = self.parent[*robot]?;
            *transform_end_robot = transform_end_robot.then(&edges[through].transform_from(*robot));
            *robot = parent;
            on_path.push(through);
        }
        let [(_, transform_from_meet), (_, transform_to_meet)] = sides;
        Some((on_path, transform_from_meet.then(&transform_to_meet.inverse())))
    }

    /// `T_root_robot` for every robot, along its tree.
    pub fn poses_by_tree(&self, edges: &[Edge]) -> Vec<UncertainPose> {
        let mut poses = vec![UncertainPose::identity(); self.parent.len()];
        for &robot in &self.order {
            if let Some((through, parent)) = self.parent[robot] {
                poses[robot] = poses[parent].then(&edges[through].transform_from(parent));
            }
        }
        poses
    }

    /// `T_root_robot` for every robot in the tree of `root`, along the tree.
    pub fn poses(&self, edges: &[Edge], root: usize) -> Vec<Option<UncertainPose>> {
        let mut poses = vec![None; self.parent.len()];
        for &robot in &self.order {
            poses[robot] = match self.parent[robot] {
                None => (robot == root).then(UncertainPose::identity),
                Some((through, parent)) => {
                    let step = edges[through].transform_from(parent);
                    poses[parent].as_ref().map(|pose: &UncertainPose| pose.then(&step))
                }
            };
        }
        poses
    }
}

fn take_cheapest(border: &mut Vec<usize>, cost: &[f64]) -> Option<usize> {
    let cheapest = (0..border.len()).min_by(|&i, &j| {
        let (a, b) = (border[i], border[j]);
        cost[a].total_cmp(&cost[b]).then(a.cmp(&b))
    })?;
    Some(border.swap_remove(cheapest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use nalgebra::Matrix3;

    fn edge(a: usize, b: usize, x: f64, variance: f64) -> Edge {
        let covariance = Matrix3::identity() * variance;
        Edge { a, b, transform_a_b: UncertainPose { pose: pose(x, 0.0, 0.0), covariance } }
    }

    #[test]
    fn a_robot_is_reached_along_the_most_certain_path() {
        let edges = [edge(0, 1, 1.0, 1.0), edge(1, 2, 1.0, 1.0), edge(0, 2, 5.0, 3.0)];
        let forest = Forest::grow(4, &edges, 0, |_| true);
        let poses = forest.poses(&edges, 0);
        assert_eq!(poses[2].unwrap().pose.translation.x, 2.0);
        assert!(forest.contains(1, &edges[1]) && !forest.contains(2, &edges[2]));
        let cycle = forest.cycle(&edges, 2).unwrap();
        assert_eq!((cycle.edges[0], cycle.edges.len(), cycle.remainder.pose.translation.x), (2, 3, 3.0));
        assert_eq!(forest.path(&edges, 2, 1).unwrap().1.pose.translation.x, -1.0);
        assert!(forest.path(&edges, 2, 3).is_none());
    }

    #[test]
    fn a_cycle_returns_along_the_most_certain_path() {
        let edges = [edge(0, 1, 1.0, 1.0), edge(1, 2, 1.0, 1.0), edge(0, 2, 5.0, 3.0), edge(2, 0, -4.0, 4.0)];
        let neighbours = Neighbours::new(4, &edges);
        let cycle = neighbours.cycle(&edges, 2, |_| true).unwrap();
        assert_eq!((cycle.edges, cycle.remainder.pose.translation.x), (vec![2, 1, 0], 3.0));
        let cycle = neighbours.cycle(&edges, 2, |index| index != 1).unwrap();
        assert_eq!((cycle.edges, cycle.remainder.pose.translation.x), (vec![2, 3], 1.0));
        assert!(neighbours.cycle(&edges, 2, |index| index == 0).is_none());
    }

    #[test]
    fn robots_without_edges_are_trees_by_themselves() {
        let edges = [edge(1, 2, 1.0, 1.0)];
        let forest = Forest::grow(4, &edges, 3, |_| true);
        let placed: Vec<bool> = forest.poses(&edges, 1).iter().map(Option::is_some).collect();
        assert_eq!(placed, [false, true, true, false]);
        assert!(Forest::grow(0, &[], 0, |_| true).poses(&[], 0).is_empty());
    }
}
