// SPDX-License-Identifier: Apache-2.0
// A module for the test of loading modules.
extern "C" __attribute__((visibility("default"))) int dkb_test_answer() {
  return 42;
}
