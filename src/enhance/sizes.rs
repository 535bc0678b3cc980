//! How [`SizeLog`] counts an image by the plan of its sizes.

use super::size_plan::{SizePlan, SizeRule};
use super::tiles::Seam;
use crate::types::SizeLog;

impl SizeLog {
    /// Counts an image, and notes the sizes that its run had to have.
    pub(super) fn add_rule(&mut self, rule: SizeRule) {
        self.images += 1;
        if !rule.takes_any_size() {
            let [height, width] = rule.fixed;
            self.fixed = Some([width, height]);
        }
        if rule.multiple > 1 {
            self.multiple = Some(rule.multiple);
        }
    }

    /// Counts an image of a height and width that went through whole, filled or in tiles.
    pub(super) fn add_planned(
        &mut self,
        size: [usize; 2],
        rule: SizeRule,
        plan: &SizePlan,
        seam: Seam,
    ) {
        self.add_rule(rule);
        let (is_padded, is_tiled) = (plan.cut.area != size, plan.tiles.count() > 1);
        self.whole += usize::from(!is_padded && !is_tiled);
        if is_padded {
            self.padded += 1;
            self.pad = Some(rule.pad.to_string());
        }
        if is_tiled {
            let [height, width] = plan.fed();
            self.tiled += 1;
            self.tile = self.tile.max(Some([width, height]));
            self.context = self.context.max(Some(plan.cut.context));
            self.seam.compared += seam.compared;
            self.seam.differing += seam.differing;
            self.seam.most = self.seam.most.max(seam.max_difference);
        }
    }
}
