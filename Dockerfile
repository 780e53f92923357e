# An image with all that the tests ask: gnss-sdr, RTKLIB, a browser, cssrlib, and the exact Python packages of constraints.txt.
#
#   docker build -t vestige-tests .
#   docker run --rm --shm-size 1g vestige-tests              # make test-all
#   docker run --rm --shm-size 1g vestige-tests .ci/run      # what a landing must pass
#
# The image was built with buildah, and `make test-all` was run in it (CONTRIBUTING.md).
# Tests on recordings that the repository does not hold are skipped, with a reason.
FROM debian:bookworm-slim

RUN apt-get update \
 && apt-get install --yes --no-install-recommends \
      ca-certificates chromium chromium-driver gnss-sdr make python3 python3-venv rtklib \
 && rm -rf /var/lib/apt/lists/*

# A user without rights: some tests show what vestige says about files that it may not read or write.
RUN useradd --create-home tester
USER tester
WORKDIR /home/tester/vestige
COPY --chown=tester . .
RUN make setup judges

CMD ["make", "test-all"]
