//! Shapes by their names, and what of the morph targets they set.

use super::{Expression, MorphTarget};

/// The morph targets that a name stands for, and the weight of each when the shape is fully there: those of an expression
/// of that name, otherwise all targets with that name. Empty for a name that nothing has.
pub fn targets_of_shape(expressions: &[Expression], targets: &[MorphTarget], name: &str) -> Vec<(usize, f32)> {
    let of_expression: Vec<(usize, f32)> = expressions
        .iter()
        .filter(|expression| expression.name == name)
        .flat_map(|expression| &expression.targets)
        .map(|&(target, full)| (target as usize, full))
        .filter(|(target, _)| *target < targets.len())
        .collect();
    if !of_expression.is_empty() {
        return of_expression;
    }
    targets.iter().enumerate().filter(|(_, target)| target.name == name).map(|(index, _)| (index, 1.0)).collect()
}

/// Sets the morph targets of several shapes. Shapes that share a target add up there; targets of none keep their weight.
/// `weights` and `touched`: one for each target; what was in `touched` is overwritten.
pub fn set_shapes<'a>(
    shapes: impl Iterator<Item = (&'a [(usize, f32)], f32)>,
    weights: &mut [f32],
    touched: &mut [bool],
) {
    touched.fill(false);
    for (targets, weight) in shapes {
        for &(target, full) in targets {
            let before = if std::mem::replace(&mut touched[target], true) { weights[target] } else { 0.0 };
            weights[target] = before + full * weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_on_one_target_add_up_and_others_stay() {
        let target = |name: &str| MorphTarget { name: name.into(), ..MorphTarget::default() };
        let targets = [target("open"), target("wide"), target("open")];
        let happy = Expression { name: "happy".into(), targets: vec![(0, 0.5), (1, 1.0), (9, 1.0)] };
        let of = |name: &str| targets_of_shape(std::slice::from_ref(&happy), &targets, name);
        assert_eq!(of("happy"), [(0, 0.5), (1, 1.0)]);
        assert_eq!(of("open"), [(0, 1.0), (2, 1.0)]);
        assert!(of("sad").is_empty());
        let (mut weights, mut touched) = ([0.1, 0.2, 0.3], [true; 3]);
        set_shapes(
            [(of("open").as_slice(), 0.25), (of("happy").as_slice(), 1.0)].into_iter(),
            &mut weights,
            &mut touched,
        );
        assert_eq!(weights, [0.75, 1.0, 0.25]);
        let mut weights = [0.1, 0.2, 0.3];
        set_shapes([(of("open").as_slice(), 0.0)].into_iter(), &mut weights, &mut touched);
        assert_eq!(weights, [0.0, 0.2, 0.0]);
    }
}
