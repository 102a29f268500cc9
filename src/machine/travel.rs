//! The travel: how far the machine may go on the page.

use super::{Kinematics, Setting, Settings, Value};
use crate::drawing::{PAGE_LIMIT, PagePoint};

impl Settings {
    /// How far `point` lies beyond the travel of x and y, in millimetres: negative if it lies below
    /// 0, zero if the pen may go there.
    pub(super) fn beyond_travel(&self, point: PagePoint) -> [Value; 2] {
        let is_limited = Kinematics::properties(self).is_limited || self.is_on(Setting::SoftLimits);
        let travel = self.page_point([Setting::TravelX, Setting::TravelY]);
        let beyond = |at: i32, travel: i32| {
            let (least, most) =
                if is_limited { (0, travel.min(PAGE_LIMIT)) } else { (-PAGE_LIMIT, PAGE_LIMIT) };
            at.saturating_sub(at.min(most).max(least))
        };
        self.millimetres(PagePoint { x: beyond(point.x, travel.x), y: beyond(point.y, travel.y) })
    }
}
