# SPDX-License-Identifier: Apache-2.0
# Shortcuts around CMake; `make help` lists them.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

JOBS ?= $(shell nproc)
PREFIX ?= /usr/local
DKB_SLAM := build/apps/dkb-slam
SOURCES = $(shell git ls-files '*.cpp' '*.h' '*.inl')
# ThreadSanitizer's shadow memory collides with address-space randomisation on recent kernels.
NO_ASLR := $(shell setarch $$(uname -m) -R true 2>/dev/null && echo setarch $$(uname -m) -R)

.PHONY: help deps build demo test test-san test-asan test-tsan bench format lint clean install

help:  ## List the targets
	@grep -E '^[a-z-]+:.*## ' $(firstword $(MAKEFILE_LIST)) | sed -E 's/:.*## /\t/' | expand -t 12

deps:  ## Install missing packages (Debian 12, Ubuntu 22.04 and newer)
	@bash scripts/deps.sh

build: deps  ## Release build of the executable: build/apps/dkb-slam
	cmake --preset release
	cmake --build build --target dkb-slam -j $(JOBS)

demo: build  ## Simulate a sequence with people, run SLAM on it, score it: demo/
	bash scripts/demo.sh $(DKB_SLAM) demo

test: deps  ## Release build of everything, then all tests
	cmake --preset release
	cmake --build build -j $(JOBS)
	ctest --test-dir build --output-on-failure -j $(JOBS)

test-san: test-asan test-tsan  ## Unit tests under AddressSanitizer + UBSan, then ThreadSanitizer

test-asan: deps
	cmake --preset asan
	cmake --build build-asan --target unit_tests -j $(JOBS)
	ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1 \
	UBSAN_OPTIONS=print_stacktrace=1 \
	ctest --test-dir build-asan -L unit --output-on-failure --no-tests=error -j $(JOBS)

test-tsan: deps
	cmake --preset tsan
	$(NO_ASLR) cmake --build build-tsan --target unit_tests -j $(JOBS)
	TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1 \
	$(NO_ASLR) ctest --test-dir build-tsan -L unit --output-on-failure --no-tests=error -j $(JOBS)

# These want sequences made for them: docs/benchmarks.md.
NEED_SEQUENCES = $(addprefix bench/,correction_bench.cpp dense_bench.cpp movers_bench.cpp relocalise_bench.cpp soak_bench.cpp)

bench: deps  ## Build and run the benchmarks (DKB_DATA=folder of real sequences)
	cmake --preset bench
	cmake --build build-bench -j $(JOBS)
	for program in $(filter-out $(NEED_SEQUENCES),$(wildcard bench/*_bench.cpp)); do \
	  name=$$(basename "$$program" .cpp); "build-bench/bench/$$name"; done

format:  ## Format the C++ sources in place
	@bash scripts/deps.sh lint
	clang-format -i $(SOURCES)

lint:  ## Check format, clang-tidy and cppcheck
	@bash scripts/deps.sh lint
	cmake --preset lint
	bash scripts/lint.sh build-lint $(JOBS)

install: deps  ## Install the executable and the library under PREFIX (/usr/local)
	cmake --preset release
	cmake --build build -j $(JOBS)
	cmake --install build --prefix $(PREFIX)

clean:  ## Remove every build folder and the demo's output
	rm -rf build build-asan build-tsan build-bench build-lint demo
