//! Counts of enhanced images in a [`SizeLog`]: whole, padded and tiled.

use super::size_plan::{SizePlan, SizeRule};
use super::tiles::Seam;
use darkqa_base::types::SizeLog;

/// Counts an image, and records the fixed size or the multiple that its run needed.
pub(crate) fn count_image(log: &mut SizeLog, rule: SizeRule) {
    log.images += 1;
    if !rule.takes_any_size() {
        let [height, width] = rule.fixed;
        log.fixed = Some([width, height]);
    }
    if rule.multiple > 1 {
        log.multiple = Some(rule.multiple);
    }
}

/// Counts an image of height and width `size` that was enhanced by a plan: whole, padded or in tiles.
pub(crate) fn count_planned(log: &mut SizeLog, size: [usize; 2], rule: SizeRule, plan: &SizePlan, seam: Seam) {
    count_image(log, rule);
    let (is_padded, is_tiled) = (plan.geometry.area != size, plan.tiles.count() > 1);
    log.whole += usize::from(!is_padded && !is_tiled);
    if is_padded {
        log.padded += 1;
        log.pad = Some(rule.pad.to_string());
    }
    if is_tiled {
        let [height, width] = plan.run_size();
        log.tiled += 1;
        log.tile = log.tile.max(Some([width, height]));
        log.context = log.context.max(Some(plan.geometry.context));
        log.seam.compared += seam.compared;
        log.seam.black += seam.black;
        log.seam.differing += seam.differing;
        log.seam.most = log.seam.most.max(seam.max_difference);
    }
}
