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

.PHONY: help deps deps-san build onnxruntime python demo test test-san test-asan test-tsan bench docs format lint clean install

help:  ## List the targets
	@grep -E '^[a-z-]+:.*## ' $(firstword $(MAKEFILE_LIST)) | sed -E 's/:.*## /\t/' | expand -t 12

deps:  ## Install missing packages (Debian 12, Ubuntu 22.04 and newer)
	@bash scripts/deps.sh

# These two install no packages: they name the missing ones.
build:  ## Release build of the executable and the library: build/apps/dkb-slam, build/lib
	@bash scripts/deps.sh check
	cmake --preset program
	cmake --build build --target dkb-slam dkb_shared dkb_static -j $(JOBS)

install: build  ## Install the executable and the library under PREFIX (/usr/local)
	cmake --install build --prefix $(PREFIX)

onnxruntime:  ## ONNX Runtime, which runs networks in a quarter of OpenCV's time, by npm: build/onnxruntime
	@bash scripts/onnxruntime.sh build/onnxruntime

python:  ## Python package for /usr/bin/python3: build/python (PYTHONPATH), installs what is missing
	@bash scripts/deps.sh python
	cmake --preset program -D DKB_PYTHON=ON -D Python_EXECUTABLE=/usr/bin/python3
	cmake --build build --target dkb_python -j $(JOBS)

demo: deps  ## Simulate a sequence with people, run SLAM on it, score it: demo/
	@$(MAKE) --no-print-directory build
	bash scripts/demo.sh $(DKB_SLAM) demo

test: deps  ## Release build of everything, then all tests
	@$(MAKE) --no-print-directory onnxruntime || echo "without ONNX Runtime: its tests are skipped"
	cmake --preset release -D DKB_PYTHON=ON
	cmake --build build -j $(JOBS)
	ctest --test-dir build --output-on-failure -j $(JOBS)

test-san: test-asan test-tsan  ## Unit tests under AddressSanitizer + UBSan, those with threads under ThreadSanitizer

# Clang's sanitizers see more than GCC's, and take two thirds of the time to build and half of it to run.
deps-san:
	@bash scripts/deps.sh san

test-asan: deps-san
	cmake --preset asan
	cmake --build build-asan --target unit_tests -j $(JOBS)
	ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1 \
	UBSAN_OPTIONS=print_stacktrace=1 LSAN_OPTIONS=suppressions=$(CURDIR)/cmake/leaks.supp:print_suppressions=0 \
	ctest --test-dir build-asan -L unit --output-on-failure --no-tests=error -j $(JOBS)

test-tsan: deps-san
	cmake --preset tsan
	$(NO_ASLR) cmake --build build-tsan --target thread_tests -j $(JOBS)
	TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1:suppressions=$(CURDIR)/cmake/threads.supp:print_suppressions=0 \
	$(NO_ASLR) ctest --test-dir build-tsan -L threads --output-on-failure --no-tests=error -j $(JOBS)

# These want sequences made for them: docs/benchmarks.md.
NEED_SEQUENCES = $(addprefix bench/,correction_bench.cpp covariance_bench.cpp dense_bench.cpp detector_bench.cpp movers_bench.cpp relocalise_bench.cpp soak_bench.cpp)

bench: deps  ## Build and run the benchmarks (DKB_DATA=folder of real sequences)
	cmake --preset bench
	cmake --build build-bench -j $(JOBS)
	for program in $(filter-out $(NEED_SEQUENCES),$(wildcard bench/*_bench.cpp)); do \
	  name=$$(basename "$$program" .cpp); "build-bench/bench/$$name"; done

docs:  ## Site of the library and the documents: build/docs/html/index.html
	@bash scripts/deps.sh docs
	@mkdir -p build/docs
	DKB_SLAM_VERSION=$$(sed -n 's/.*define DKB_SLAM_VERSION "\(.*\)"/\1/p' include/dkb_slam/version.h) doxygen docs/Doxyfile

format:  ## Format the C++ sources in place
	@bash scripts/deps.sh lint
	clang-format -i $(SOURCES)

lint:  ## Check format, clang-tidy and cppcheck
	@bash scripts/deps.sh lint
	cmake --preset lint
	bash scripts/lint.sh build-lint $(JOBS)

clean:  ## Remove every build folder and the demo's output
	rm -rf build build-asan build-tsan build-bench build-lint build-cp* demo
