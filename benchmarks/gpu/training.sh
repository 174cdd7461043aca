#!/usr/bin/env bash
# Trainings from pictures that are still to be run, each with its evaluation on held-out start states.
#
#     OUT=out/training bash benchmarks/gpu/training.sh pools       # start states; processors only: 250 s on 16 cores
#     OUT=out/training bash benchmarks/gpu/training.sh humanoid fetch      # side by side on one card: 520 s
#
# pools: what the first four begin from.  humanoid, fetch: SlicingFruit by DAgger.  towel: Fetch's towel without mittens
# by DAgger.  towel_sac: by SAC, which an expert begins for.  choices, mean: the humanoid's fruit for 120 s with choices
# and with a Gaussian's mean.  sight: what the encoders tell of unseen start states, 60 s each; nobody acts.
# shipped: three policies that ship, on Warp.
# updates: of the clone alone, with their kernels.
# speed: an evaluation of 1,000 worlds, then again with everything compiled (start_seconds, steps_per_second).
# steps: what a step called from Python costs beside twenty in one program, and which CUDA graphs are captured anew; then
# with graphs that copy what lies elsewhere. A minute each where kernels are compiled.
#
# Below $OUT: the best and the last policy, progress.csv, evaluations.jsonl (the likeliest actions, then drawn ones) and
# the log of each, copied while it trains. $MINUTES of training (5), $WORLDS, $ENGINE (warp), $FRACTION of a card's memory
# that JAX takes for each training (0.26), $BATCH, $RATE (of learning), $CAPACITY, $STARTS and $LOOK: pictures of start
# states, and updates of the guess on them; $UPDATES: for each step of the worlds; $AVERAGE: of how many updates the weights
# that act are the mean (0); $TOLD: samples of an update without pictures; $BELIEVED=0: labels are for where things are;
# with $RECALL=0 also: actors remember nothing; $ACTOR: sizes of the layers after the encoder (160,160); $READY: seconds
# until training begins, at most; $PLAY=0: no evaluation on the card.
set -u
out=${OUT:-out/training}; mkdir -p "$out"
minutes=${MINUTES:-5} engine=${ENGINE:-warp} fraction=${FRACTION:-0.26}
pictures=(--set net=glimpses shift=0 actor="${ACTOR:-160,160}" capacity="${CAPACITY:-500000}" batch="${BATCH:-512}")
dagger=(lr="${RATE:-2e-3}" last_lr=1e-4 recall="${RECALL:-1}" believed="${BELIEVED:-1}" told="${TOLD:-4096}"
  updates="${UPDATES:-16}" average="${AVERAGE:-0}")

sample() { nice -n 10 env JAX_PLATFORMS=cpu python3 -m ig2mj sample-task "$@" >> "$out/pools.txt" 2>&1; }

held() {  # NAME POLICY EPISODES WORDS...: adds a line of JSON
  local name=$1 policy=$2 episodes=$3; shift 3; mkdir -p "$out/$name"
  XLA_PYTHON_CLIENT_MEM_FRACTION=0.1 timeout 300 python3 -m ig2mj evaluate "$policy" --episodes "$episodes" --worlds "${EVAL_WORLDS:-500}" \
    --engine "$engine" --json "$@" >> "$out/$name/evaluations.jsonl" 2>> "$out/$name/log.txt"
}

learn() {  # NAME EPISODES WORDS...: trains, and plays so many held-out episodes with and without chance
  local name=$1 episodes=$2 run; shift 2; mkdir -p "$out/$name"; run=$(mktemp -d)
  XLA_PYTHON_CLIENT_MEM_FRACTION=$fraction timeout $((${minutes%.*} * 60 + 60 + ${READY:-300})) \
    python3 -m ig2mj train "$@" --obs rgbd --engine "$engine" --out "$run/run" > "$out/$name/log.txt" 2>&1 &
  local job=$!
  while kill -0 $job 2> /dev/null; do sleep 5; cp "$run"/run/*.npz "$run/run/progress.csv" "$out/$name" 2> /dev/null; done
  wait $job; echo "$name: trained, ended with $? after $SECONDS s" | tee -a "$out/times.txt"
  if [ "${PLAY:-1}" = 1 ]; then
    held "$name" "$out/$name/policy.npz" "$episodes"
    held "$name" "$out/$name/policy.npz" 500 --stochastic
  fi
  echo "$name: played after $SECONDS s" | tee -a "$out/times.txt"; rm -rf "$run"; [ ! -f "$out/$name/evaluations.jsonl" ] || cut -c1-600 "$out/$name/evaluations.jsonl"
}

fruit() {  # NAME ROBOT ROWS WORDS...
  learn "$1" 1000 SlicingFruit --robot "$2" --rows "$3" --algo dagger --pixels 128 --worlds "${WORLDS:-2048}" \
    --pool-size 4096 --mixed 200000 --minutes "$minutes" "${pictures[@]}" "${dagger[@]}" starts="${STARTS:-49152}" look="${LOOK:-3000}" "${@:4}"
}

sight() {  # ROBOT ROWS NET: the guess alone, from start states
  mkdir -p "$out/sight"
  XLA_PYTHON_CLIENT_MEM_FRACTION=$fraction timeout 300 python3 benchmarks/sight.py SlicingFruit --robot "$1" --rows "$2" --net "$3" \
    --engine "$engine" --worlds "${SIGHT_WORLDS:-1000}" --mixed 200000 --starts "${STARTS:-16384}" --updates "${LOOK:-3000}" \
    --batch "${BATCH:-256}" > "$out/sight/$1-$3.jsonl" 2> "$out/sight/$1-$3.txt"
}

towel() {  # NAME WORDS...
  learn "$1" 1000 SoakingTowel --robot fetch --grasping physical --pixels 128 --rows 32:80 --worlds "${WORLDS:-1024}" --pool-size 1024 \
    --minutes "$minutes" "${@:2}"
}

run() {
  case $1 in
    pools)
      sample SlicingFruit --split train --count 4096; sample SlicingFruit --split held_out
      sample SoakingTowel --grasping physical --split train --count 1024; sample SoakingTowel --grasping physical --split held_out ;;
    humanoid) fruit fruit_humanoid humanoid 80:128 ;;
    fetch) fruit fruit_fetch fetch 60:108 ;;
    sight) for net in glimpses places; do sight humanoid 80:128 $net & sight fetch 60:108 $net & wait; done ;;
    towel) towel towel_dagger --algo dagger "${pictures[@]}" "${dagger[@]}" length=8 starts="${STARTS:-16384}" look="${LOOK:-3000}" opening=30 ;;
    towel_sac)
      towel towel_sac --algo sac --expert --until 0.95 "${pictures[@]}" gamma=0.99 horizon=5 held=8 std=0.1 guided=0.6 copied=1 \
        copy=2 trust=1 reach=110 alpha=0.003 ;;
    choices) minutes=2; fruit choices humanoid 80:128 choices=21 ;;
    mean) minutes=2; fruit mean humanoid 80:128 choices=0 ;;
    shipped)
      for name in CookingMeat GraspingBook BimanualPickAndPlace; do held "$name" "$name" 500 & done; wait
      cut -c1-600 "$out"/*/evaluations.jsonl ;;
    speed)
      for _ in cold warm; do EVAL_WORLDS=1000 held speed CookingMeat 1000; done
      cut -c1-600 "$out/speed/evaluations.jsonl" ;;
    updates)
      for batch in 256 512 1024; do
        python3 benchmarks/learner.py --algo dagger --obs rgbd --pixels 128 --rows 80:128 --batch $batch --capacity 200000 --starts 16384 \
          --seconds 5 --kernels 40 --set "${pictures[@]:1:3}" recall=1 told="${TOLD:-4096}" >> "$out/updates.jsonl" 2>> "$out/updates.txt"
      done ;;
    steps)
      mkdir -p "$out/steps"
      for mode in "" "--graph-mode WARP_STAGED"; do
        timeout 150 python3 benchmarks/steps_from_python.py CookingMeat --worlds "${EVAL_WORLDS:-1000}" $mode \
          --rows "$out/steps/rows.jsonl" >> "$out/steps/log.txt" 2>&1
      done
      cut -c1-600 "$out/steps/rows.jsonl" ;;
    *) sed -n '2,/^set /{/^#/p}' "$0"; exit 2 ;;
  esac
}

[ $# != 0 ] || run help
for name; do run "$name" & done
wait
