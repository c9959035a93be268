// SPDX-License-Identifier: Apache-2.0
#include "render/common/dispatched_target.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/common/dispatched_target.cpp"
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

std::int64_t target() { return HWY_TARGET; }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace raystage::render {

HWY_EXPORT(target);

std::int64_t dispatched_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::render
#endif
