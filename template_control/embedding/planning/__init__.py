"""What happens between two sections: the decision, the path that follows it, and plans anew."""
