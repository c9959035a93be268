// SPDX-License-Identifier: Apache-2.0
// raystage-version.so, in lib/raystage: what raystage --version prints.
#include "cli/version.h"

extern "C" __attribute__((visibility("default"))) const char* raystage_version_text() {
  static const std::string text = raystage::cli::version_text();
  return text.c_str();
}
